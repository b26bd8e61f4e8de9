"""What moves freely, and what it meets: the soft body, rigid bodies, obstacles, points that are held, cables."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.body import Surface
from tripod_view.cable import SLACK_COLOUR, TAUT_COLOUR, Route, radius, tube, tube_triangles
from tripod_view.drawing import Drawing, Node, Rgb
from tripod_view.frame import span
from tripod_view.picture import Part, Picture
from tripod_view.shade import shade

SOLID: Rgb = (247, 205, 165)
SPRINGS: Rgb = (96, 140, 200)
RIGID: tuple[Rgb, ...] = ((214, 120, 64), (70, 150, 130), (150, 110, 180), (200, 170, 60))
OBSTACLE: Rgb = (168, 174, 184)
HELD: Rgb = (60, 60, 70)


class DrawnCable:
    """A cable as it is drawn: also through bodies."""

    def __init__(
        self, drawing: Drawing, number: int, route: Route, surface: Surface, extent: float, slack: bool
    ) -> None:
        """`number`: by which it is named; `extent`: of the bodies [m]."""
        self.route, self._extent, self._slack, self._nodes = route, extent, slack, surface.nodes
        triangles = tube_triangles(len(route.fixed))
        self.node = drawing.mesh(
            f"/cables/{number}", self._tube(), triangles, self._colour, deforms=True, through=True
        )

    @property
    def _colour(self) -> Rgb:
        return SLACK_COLOUR if self._slack else TAUT_COLOUR

    def _tube(self) -> NDArray[np.float32]:
        radii = radius(self._extent, np.array([0.0 if self._slack else np.inf]))
        return tube(self.route.points(self._nodes)[None], radii)[0].astype(np.float32)

    def move(self, positions: FloatArray) -> None:
        """Run through the points of a mesh whose nodes are at `positions` [m], shape (n, 3)."""
        self._nodes = positions
        self.node.set("vertices", self._tube())

    def set_slack(self, slack: bool) -> None:
        """Look slack, or taut."""
        if slack != self._slack:
            self._slack = slack
            self.node.set("colour", self._colour)
            self.node.set("vertices", self._tube())


class Bodies:
    """Draws what it is told; every method is called from the thread of ROS only."""

    def __init__(self, drawing: Drawing) -> None:
        self._drawing = drawing
        self._parts: list[tuple[Part, Node]] = []
        self._still: list[Node] = []
        self._cables: list[DrawnCable] = []
        self._slack: frozenset[str] = frozenset()
        self._fields: dict[str, list[tuple[Part, Node]]] = {}

    def set_surface(self, surface: Surface, parts: tuple[Part, ...], cables: tuple[Route, ...] = ()) -> None:
        """Show another mesh, undeformed; without parts, or with parts that do not fit it, it is one solid."""
        for node in [*(node for _, node in self._parts), *(cable.node for cable in self._cables)]:
            node.remove()
        self._fields.clear()
        count = len(surface.nodes)
        extent = float(np.ptp(surface.nodes, axis=0).max(initial=0.0)) if count else 0.0
        self._cables = [
            DrawnCable(self._drawing, i, cable, surface, extent, cable.name in self._slack)
            for i, cable in enumerate(cable for cable in cables if cable.fits(count))
        ]
        ends = [part.first + part.count for part in parts]
        fits = bool(parts) and max(ends) == count and all(p.first >= 0 and p.count > 0 for p in parts)
        whole = (Part("body", "solid", 0, count),)
        kinds = Counter[str]()
        self._parts = []
        for i, part in enumerate(parts if fits else whole):
            colour = _colour(part, kinds[part.kind])
            self._parts.append((part, self._draw(i, part, surface, colour)))
            kinds[part.kind] += 1

    def _draw(self, number: int, part: Part, surface: Surface, colour: Rgb) -> Node:
        """Draw a part of the mesh. `number`: by which it is named: its own name may be that of anything else."""
        first, end = part.first, part.first + part.count
        inside = ((surface.triangles >= first) & (surface.triangles < end)).all(axis=1)
        triangles = surface.triangles[inside] - first
        nodes = surface.nodes[first:end]
        more: dict[str, Any] = {"deforms": True, "name": part.name, "first": first}
        if part.kind != "rigid":
            more["rest"] = nodes.astype(np.float32)
        return self._drawing.mesh(f"/bodies/{number}", nodes, triangles, colour, **more)

    def set_nodes(self, positions: FloatArray) -> None:
        """Move the nodes of the mesh to `positions` [m], shape (n, 3)."""
        nodes = positions.astype(np.float32)
        for part, node in self._parts:
            node.set("vertices", nodes[part.first : part.first + part.count])
        for cable in self._cables:
            cable.move(positions)

    def set_field(self, name: str, values: FloatArray | None) -> None:
        """Tell a field at the nodes of the mesh, shape (n,); None: not any more. Rigid bodies have none."""
        if values is None:
            for _, node in self._fields.pop(name, []):
                node.remove()
            return
        of = {part.first: values[part.first : part.first + part.count] for part, _ in self._parts}
        if name in self._fields:
            for part, node in self._fields[name]:
                node.set("values", of[part.first])
            return
        self._fields[name] = [
            (part, self._drawing.add(f"{body.path}/{name}", "field", values=of[part.first]))
            for part, body in self._parts
            if part.kind != "rigid"
        ]

    def set_slack(self, names: frozenset[str]) -> None:
        """Show which cables are slack, by their names."""
        if names != self._slack:
            self._slack = names
            for cable in self._cables:
                cable.set_slack(cable.route.name in names)

    def set_seen(self, seen: Sequence[bool]) -> None:
        """Tell of each part whether the camera is to fit it."""
        for (_, node), fits in zip(self._parts, seen, strict=True):
            node.set("fits", bool(fits))

    def boxes(self, positions: FloatArray) -> FloatArray:
        """Return the box about each part where the nodes are at `positions` [m], shape (parts, 2, 3)."""
        ends = ((part.first, part.first + part.count) for part, _ in self._parts)
        return np.array([span(positions[first:end]) for first, end in ends])

    def set_still(self, picture: Picture) -> None:
        """Show obstacles and held points of a scene instead of those before."""
        for node in self._still:
            node.remove()
        self._still = [
            self._drawing.mesh(f"/obstacles/{i}", o.nodes, o.triangles, OBSTACLE, fits=False)
            for i, o in enumerate(picture.obstacles)
        ]
        if len(picture.held):
            size = 0.012 * (float(np.ptp(picture.held, axis=0).max()) or 1.0)
            held = self._drawing.add("/held", "points", vertices=picture.held, colour=HELD, size=size)
            self._still.append(held)


def _colour(part: Part, number: int) -> Rgb:
    """Return the colour of a part; `number`: of its kind."""
    if part.kind == "rigid":
        return RIGID[number % len(RIGID)]
    return shade(SPRINGS if part.kind == "springs" else SOLID, number)
