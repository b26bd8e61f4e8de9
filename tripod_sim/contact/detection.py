"""Detection: what is near at the start of a step, and what meets during it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.contact import ccd_kernels, narrow_kernels
from tripod_sim.contact.broad_phase import Boxes, Tree
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.narrow_kernels import BALLS, EDGES, FACES, SEGMENTS
from tripod_sim.contact.region_kernels import Topology
from tripod_sim.mesh.surfaces import Surfaces

LEAST = 0.1
"""Fraction of the contact distance that continuous detection never lets go of."""


@dataclass(eq=False)
class _Query:
    """One kind of pair: moving shapes against fixed ones in a tree built once, or against moving ones.

    ones, others: Numbers of the shapes of each pair, of the kind `first`, as the kernels take them. `flipped`: the
    points are fixed.
    """

    boxes: Boxes
    tree: Tree
    target: Boxes
    ones: IndexArray
    others: IndexArray
    first: int
    flipped: bool

    def pairs(self, margin: float) -> IndexArray:
        """Return the pairs nearer than `margin` [m], besides radii, along each axis."""
        return self.tree.pairs(None if self.boxes is self.target else self.boxes, margin)


class Detector:
    """Finds contacts among the surfaces of bodies, moving against fixed and, if there are any, moving ones.

    Attributes:
        pairs: Pairs that the last broad phase left.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        vertices: FloatArray,
        distance: float,
        alarm: float,
        held: BoolArray | None = None,
    ) -> None:
        """Build the trees of what never moves.

        Args:
            surfaces: All bodies.
            vertices: Positions [m], shape (n, 3).
            distance: Contact distance [m].
            alarm: Alarm distance [m], larger.
            held: Vertices that do not yield, shape (n,): shapes of such vertices alone do not touch what is fixed.
        """
        s = self._surfaces = surfaces
        self.distance, self.alarm, self.pairs = distance, alarm, 0
        self._top = Topology._make(getattr(s, name) for name in Topology._fields)
        self._moving = np.zeros(len(vertices), dtype=np.bool_)
        self._moving[s.moving_points] = True
        self._earliest, self._move = np.ones(len(vertices)), np.zeros((len(vertices), 3))
        self._when: list[FloatArray] = []
        points, faces, edges = s.moving_points, s.moving_triangles, s.moving_edges
        round_ones = s.radius > 0
        balls, fixed_balls = points[round_ones[points]], np.flatnonzero(round_ones & ~self._moving)
        has_radius = round_ones[s.edges[s.lone_edges, 0]]
        segments, fixed_segments = (
            np.intersect1d(s.lone_edges[has_radius], of) for of in (edges, s.fixed_edges)
        )
        chains = np.intersect1d(s.lone_edges[~has_radius], edges)
        shapes = {
            "points": points[:, None], "faces": s.triangles[faces], "edges": s.edges[edges], "balls": balls[:, None],
            "segments": s.edges[segments], "chains": s.edges[chains],
        }  # fmt: skip
        boxes = {name: self._around(shape) for name, shape in shapes.items()}
        self._trees = list[Tree]()
        self._queries: list[_Query] = []

        def against_fixed(
            name: str, mine: IndexArray, shape: IndexArray, theirs: IndexArray, first: int
        ) -> None:
            if len(mine) and len(theirs):
                target = self._around(shape)
                target.sweep(vertices, vertices)
                tree = Tree(target)
                tree.update()
                flipped, query = name in ("faces", "segments", "chains"), boxes[name]
                if held is not None and (yields := ~held[shapes[name]].all(axis=1)).sum() < len(mine):
                    mine, query = mine[yields], self._around(shapes[name][yields])
                one, other = (theirs, mine) if flipped else (mine, theirs)
                self._queries.append(_Query(query, tree, target, one, other, first, flipped))

        against_fixed("points", points, s.triangles[s.fixed_triangles], s.fixed_triangles, FACES)
        against_fixed("faces", faces, s.fixed_points[:, None], s.fixed_points, FACES)
        against_fixed("edges", edges, s.edges[s.fixed_edges], s.fixed_edges, EDGES)
        against_fixed("points", points, s.edges[fixed_segments], fixed_segments, SEGMENTS)
        against_fixed("segments", segments, s.fixed_points[:, None], s.fixed_points, SEGMENTS)
        against_fixed("chains", chains, fixed_balls[:, None], fixed_balls, SEGMENTS)
        against_fixed("balls", balls, fixed_balls[:, None], fixed_balls, BALLS)
        numbers = {
            "points": points, "faces": faces, "edges": edges, "balls": balls, "segments": segments, "chains": chains,
        }  # fmt: skip
        self._compare_moving(numbers, shapes, boxes)
        self._compare_kinematic()
        used = [q.boxes for q in self._queries] + [q.target for q in self._queries if q.tree in self._trees]
        self._boxes = list({id(b): b for b in used}.values())

    def _compare_moving(
        self, numbers: dict[str, IndexArray], shapes: dict[str, IndexArray], boxes: dict[str, Boxes]
    ) -> None:
        """Add the queries of moving bodies among each other.

        A large body that does not touch itself is set apart and only compared with others: most pairs are its own.

        Args:
            numbers: Of the moving points, faces, edges, balls, round segments and edges of chains.
            shapes: Their vertices.
            boxes: Around them.
        """
        body, itself = self._surfaces.body, self._surfaces.touches_itself
        bodies, counts = np.unique(body[numbers["points"]], return_counts=True)
        if not len(bodies) or not (len(bodies) > 1 or itself[bodies].any()):
            return
        large = int(bodies[np.argmax(counts)])
        apart = len(bodies) > 1 and not itself[large] and 2 * counts.max() > counts.sum()
        rest = bodies[bodies != large]
        chosen = dict[tuple[str, bool], tuple[IndexArray, Boxes]]()

        def part(name: str, *, of_large: bool) -> tuple[IndexArray, Boxes]:
            if not apart:
                return numbers[name], boxes[name]
            if (name, of_large) not in chosen:
                which = (body[shapes[name][:, 0]] == large) == of_large
                chosen[name, of_large] = numbers[name][which], self._around(shapes[name][which])
            return chosen[name, of_large]

        alike = [(False, False)] if not apart or len(rest) > 1 or itself[rest].any() else []
        if apart:
            alike.append((True, False))
        unlike = [*alike, (False, True)] if apart else alike
        for name, query, first, sides in (
            ("faces", "points", FACES, unlike), ("edges", "edges", EDGES, alike), ("balls", "balls", BALLS, alike),
            ("segments", "points", SEGMENTS, unlike), ("chains", "balls", SEGMENTS, unlike),
        ):  # fmt: skip
            for one, other in sides:
                (mine, asked), (theirs, target) = part(query, of_large=one), part(name, of_large=other)
                if not len(mine) or not len(theirs):
                    continue
                tree = Tree(target)
                self._trees.append(tree)
                self._queries.append(_Query(asked, tree, target, mine, theirs, first, False))

    def _compare_kinematic(self) -> None:
        """Add the queries of rigid bodies among those that are kinematic, if there are any."""
        s = self._surfaces
        rigid = s.rigid[s.body]
        points = s.moving_points[rigid[s.moving_points]]
        faces = s.moving_triangles[rigid[s.triangles[s.moving_triangles, 0]]]
        edges = s.moving_edges[rigid[s.edges[s.moving_edges, 0]]]
        segments = np.intersect1d(s.lone_edges, edges)
        for one, two, first in (
            (points, s.kinematic_triangles, FACES), (s.kinematic_points, faces, FACES),
            (edges, s.kinematic_edges, EDGES), (s.kinematic_points, segments, SEGMENTS),
        ):  # fmt: skip
            if len(one) and len(two):
                target = self._around(s.triangles[two] if first == FACES else s.edges[two])
                self._trees.append(tree := Tree(target))
                asked = self._around(s.edges[one] if first == EDGES else one[:, None])
                self._queries.append(_Query(asked, tree, target, one, two, first, False))

    def _around(self, shapes: IndexArray) -> Boxes:
        return Boxes(shapes, self._surfaces.radius[shapes].max(axis=1))

    def _sweep(self, start: FloatArray, end: FloatArray) -> None:
        for boxes in self._boxes:
            boxes.sweep(start, end)
        for tree in self._trees:
            tree.update()
        self.pairs = 0

    def warm_up(self, x: FloatArray) -> None:
        """Compile what is needed only when something meets, so that the first hit is no slower than others.

        `x`: as in `near`; nothing changes.
        """
        none, out = np.zeros((0, 2), dtype=np.int64), ContactSet()
        for q in self._queries:
            ccd_kernels.met_contacts(
                none, q.ones, q.others, q.first, q.flipped, self._top, x, self._move, self.distance, np.zeros(0),
                self._earliest, self._moving, narrow_kernels.MET, out.arrays, 0,
            )  # fmt: skip

    def near(self, x: FloatArray, out: ContactSet, before: ContactSet | None = None) -> None:
        """Fill `out` with the contacts closer than the alarm distance at positions `x` [m], shape (n, 3).

        Of two edges that pressed each other in `before` the contact is let go of later, so that it does not flicker.
        """
        held = np.zeros(0, dtype=np.int64)
        if before is not None:
            pressed = before.arrays.pressure[: before.count] > 0.0
            held = np.sort(before.arrays.key[: before.count][pressed])
        self._sweep(x, x)
        out.count = 0
        for q in self._queries:
            pairs = q.pairs(self.alarm)
            self.pairs += len(pairs)
            _add(
                out, narrow_kernels.near_contacts, pairs, q.ones, q.others, q.first, q.flipped, self._top, x,
                self.distance, self.alarm, held,
            )  # fmt: skip
        out.unique()

    def met(
        self,
        start: FloatArray,
        end: FloatArray,
        out: ContactSet,
        *,
        share: float = LEAST,
        take_all: bool = False,
    ) -> float:
        """Add to `out` what meets while vertices move from `start` to `end` [m], shape (n, 3), on straight lines.

        Met are pairs that come closer than the fraction `share` of the contact distance. Those of `out` that meet are
        replaced. Where several triangles meet one shape, those to which others are closer are left out, unless
        `take_all`.

        Returns:
            The fraction of the way until which all pairs surely keep that distance; 1 if nothing meets.
        """
        least = share * self.distance
        self._sweep(start, end)
        self._earliest[:] = 1.0
        np.subtract(end, start, out=self._move)
        while len(self._when) < len(self._queries):
            self._when.append(np.zeros(64))
        found = []
        for k, q in enumerate(self._queries):
            pairs = q.pairs(least)
            self.pairs += len(pairs)
            if len(pairs) > len(self._when[k]):
                self._when[k] = np.zeros(len(pairs) + len(pairs) // 2)
            when = self._when[k][: len(pairs)]
            ccd_kernels.times(
                pairs, q.ones, q.others, q.first, q.flipped, self._top, start, self._move, least, when,
                self._earliest,
            )  # fmt: skip
            if len(pairs) and when.min() < 1.0:
                found.append((q, pairs.copy(), when))
        if not found:
            return 1.0
        choice = narrow_kernels.ANY if take_all else narrow_kernels.MET
        for q, pairs, when in found:
            _add(
                out, ccd_kernels.met_contacts, pairs, q.ones, q.others, q.first, q.flipped, self._top, start,
                self._move, self.distance, when, self._earliest, self._moving, choice,
            )  # fmt: skip
        out.unique()
        return float(self._earliest.min())


def _add(out: ContactSet, kernel: Callable[..., int], *arguments: Any) -> None:
    """Let a kernel write contacts behind those of `out`, which grows until they fit."""
    while (end := kernel(*arguments, out.arrays, out.count)) > len(out.arrays.key):
        out.reserve(end)
    out.count = end
