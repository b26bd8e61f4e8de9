"""What moves freely, and what it meets: the soft body, rigid bodies, obstacles, points that are held, cables."""

from collections import Counter

import numpy as np
import viser
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.body import Surface
from tripod_view.cable import SLACK_COLOUR, TAUT_COLOUR, Route, radius, tube, tube_triangles
from tripod_view.frame import span
from tripod_view.picture import Part, Picture
from tripod_view.shade import Rgb, shade

SOLID: Rgb = (247, 205, 165)
SPRINGS: Rgb = (96, 140, 200)
RIGID: tuple[Rgb, ...] = ((214, 120, 64), (70, 150, 130), (150, 110, 180), (200, 170, 60))
OBSTACLE: Rgb = (168, 174, 184)
MESH_LINES: Rgb = (150, 95, 50)
SPRING_LINES: Rgb = (40, 70, 120)
HELD: Rgb = (60, 60, 70)

SEEN_THROUGH = 0.6
"""Opacity of bodies in which cables run."""


class Drawn:
    """One part of the mesh as it is drawn."""

    def __init__(
        self,
        api: viser.SceneApi,
        number: int,
        part: Part,
        surface: Surface,
        colour: Rgb,
        lines: bool,
        opacity: float | None,
    ) -> None:
        """`number`: of the part, by which it is named: its own name is the user's, and may be that of anything else
        that is drawn. `surface`: of the whole mesh; `lines`: whether its edges are shown; `opacity`: None: opaque.
        """
        self.part, self._api = part, api
        own = slice(part.first, part.first + part.count)
        inside = (surface.triangles >= own.start) & (surface.triangles < own.stop)
        triangles = (surface.triangles[inside.all(axis=1)] - part.first).astype(np.uint32)
        nodes = surface.nodes[own].astype(np.float32)
        rigid = part.kind == "rigid"
        self.handles = [
            api.add_mesh_simple(
                f"/bodies/{number}", nodes, triangles, color=colour, flat_shading=rigid, side="double",
                opacity=opacity, cast_shadow=False, receive_shadow=False,
            )
        ]  # fmt: skip
        self.lines: viser.MeshHandle | None = None
        if not rigid:
            line = SPRING_LINES if part.kind == "springs" else MESH_LINES
            self.lines = api.add_mesh_simple(
                f"/lines/{number}",
                nodes,
                triangles,
                color=line,
                wireframe=True,
                opacity=0.35,
                visible=lines,
            )
            self.handles.append(self.lines)

    def move(self, nodes: NDArray[np.float32]) -> None:
        """Put the nodes of the part where those of the mesh are [m], shape (n, 3)."""
        own = nodes[self.part.first : self.part.first + self.part.count]
        self.handles[0].vertices = own
        if self.lines is not None and self.lines.visible:
            self.lines.vertices = own

    def show_lines(self, visible: bool) -> None:
        """Show or hide the edges; hidden ones cost nothing."""
        if self.lines is not None:
            self.lines.vertices = self.handles[0].vertices
            self.lines.visible = visible

    def remove(self) -> None:
        """Take it away."""
        for handle in self.handles:
            handle.remove()


class DrawnCable:
    """A cable as it is drawn."""

    def __init__(
        self, api: viser.SceneApi, number: int, route: Route, surface: Surface, extent: float, slack: bool
    ) -> None:
        """`number`: by which it is named; `extent`: of the bodies [m]."""
        self.route, self._extent, self._slack, self._nodes = route, extent, slack, surface.nodes
        self._handle = api.add_mesh_simple(
            f"/cables/{number}", self._tube(), tube_triangles(len(route.fixed)).astype(np.uint32), side="double",
            color=SLACK_COLOUR if slack else TAUT_COLOUR, cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _tube(self) -> NDArray[np.float32]:
        radii = radius(self._extent, np.array([0.0 if self._slack else np.inf]))
        return tube(self.route.points(self._nodes)[None], radii)[0].astype(np.float32)

    def move(self, positions: FloatArray) -> None:
        """Run through the points of a mesh whose nodes are at `positions` [m], shape (n, 3)."""
        self._nodes = positions
        self._handle.vertices = self._tube()

    def set_slack(self, slack: bool) -> None:
        """Look slack, or taut."""
        if slack != self._slack:
            self._slack = slack
            self._handle.color = SLACK_COLOUR if slack else TAUT_COLOUR
            self._handle.vertices = self._tube()

    def remove(self) -> None:
        """Take it away."""
        self._handle.remove()


class Bodies:
    """Draws what it is told; every method is called from the thread of ROS only."""

    def __init__(self, api: viser.SceneApi) -> None:
        self._api = api
        self._drawn: list[Drawn] = []
        self._still: list[viser.SceneNodeHandle] = []
        self._lines = True
        self._cables: list[DrawnCable] = []
        self._slack: frozenset[str] = frozenset()

    def set_surface(self, surface: Surface, parts: tuple[Part, ...], cables: tuple[Route, ...] = ()) -> None:
        """Show another mesh, undeformed; without parts, or with parts that do not fit it, it is one solid.

        Bodies with cables are seen through.
        """
        for drawn in self._drawn:
            drawn.remove()
        for cable in self._cables:
            cable.remove()
        count = len(surface.nodes)
        extent = float(np.ptp(surface.nodes, axis=0).max(initial=0.0)) if count else 0.0
        fitting = [cable for cable in cables if cable.fits(count)]
        self._cables = [
            DrawnCable(self._api, i, cable, surface, extent, cable.name in self._slack)
            for i, cable in enumerate(fitting)
        ]
        opacity = SEEN_THROUGH if fitting else None
        ends = [part.first + part.count for part in parts]
        fits = bool(parts) and max(ends) == count and all(p.first >= 0 and p.count > 0 for p in parts)
        whole = (Part("body", "solid", 0, count),)
        kinds = Counter[str]()
        self._drawn = []
        for i, part in enumerate(parts if fits else whole):
            self._drawn.append(
                Drawn(self._api, i, part, surface, _colour(part, kinds[part.kind]), self._lines, opacity)
            )
            kinds[part.kind] += 1

    def set_nodes(self, positions: FloatArray) -> None:
        """Move the nodes of the mesh to `positions` [m], shape (n, 3)."""
        nodes = positions.astype(np.float32)
        for drawn in self._drawn:
            drawn.move(nodes)
        for cable in self._cables:
            cable.move(positions)

    def set_slack(self, names: frozenset[str]) -> None:
        """Show which cables are slack, by their names."""
        if names != self._slack:
            self._slack = names
            for cable in self._cables:
                cable.set_slack(cable.route.name in names)

    def boxes(self, positions: FloatArray) -> FloatArray:
        """Return the box about each part where the nodes are at `positions` [m], shape (parts, 2, 3)."""
        ends = ((d.part.first, d.part.first + d.part.count) for d in self._drawn)
        return np.array([span(positions[first:end]) for first, end in ends])

    def set_still(self, picture: Picture) -> None:
        """Show obstacles and held points of a scene instead of those before."""
        for handle in self._still:
            handle.remove()
        self._still = [
            self._api.add_mesh_simple(
                f"/obstacles/{i}", o.nodes.astype(np.float32), o.triangles, color=OBSTACLE,
                flat_shading=len(o.nodes) < 50, side="double", cast_shadow=False, receive_shadow=False,
            )
            for i, o in enumerate(picture.obstacles)
        ]  # fmt: skip
        if len(picture.held):
            size = float(np.ptp(picture.held, axis=0).max()) or 1.0
            self._still.append(
                self._api.add_point_cloud(
                    "/held",
                    picture.held.astype(np.float32),
                    HELD,
                    point_size=0.012 * size,
                    point_shape="circle",
                )
            )

    def show_lines(self, visible: bool) -> None:
        """Show or hide the edges of the mesh."""
        if visible != self._lines:
            self._lines = visible
            for drawn in self._drawn:
                drawn.show_lines(visible)


def _colour(part: Part, number: int) -> Rgb:
    """Return the colour of a part; `number`: of its kind."""
    if part.kind == "rigid":
        return RIGID[number % len(RIGID)]
    return shade(SPRINGS if part.kind == "springs" else SOLID, number)
