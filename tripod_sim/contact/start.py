"""Bodies that pass through obstacles at the start: named, or lifted out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray, IndexArray
from tripod_sim.contact import start_kernels as kernels
from tripod_sim.contact.broad_phase import Boxes, Tree
from tripod_sim.contact.contact_set import ContactSet
from tripod_sim.contact.detection import Detector
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import names_of
from tripod_sim.mesh.surfaces import Part, join

MOST_LIFTS = 60
"""Doublings of the lift, from the contact distance on."""


def mark_passing(
    edges: IndexArray, triangles: IndexArray, x: FloatArray, out: BoolArray, least: float = 0.0
) -> None:
    """Mark in `out`, shape (n,), the vertices at `x` [m] of edges and triangles that pass through each other.

    `least`: by how far an edge must reach through the plane of a triangle on both sides [m].
    """
    if not len(edges) or not len(triangles):
        return
    query, target = Boxes(edges), Boxes(triangles)
    for boxes in (query, target):
        boxes.sweep(x, x)
    tree = Tree(target)
    tree.update()
    kernels.mark_passing(tree.pairs(query), edges, triangles, x, least, out)


def passing(body: Part, obstacles: list[Part]) -> IndexArray:
    """Return the vertices of `body` that pass through an obstacle, or lie inside of a closed one, ascending.

    A body that lies inside as a whole is named by its first vertex. With a radius, of one or both, vertices count whose
    triangles come closer than the radii.
    """
    hard = [part for part in obstacles if not part.radius]
    if body.radius or len(hard) < len(obstacles):
        near = [within(part, body) for part in obstacles if part.radius or body.radius]
        rest = passing(body, hard) if hard and not body.radius else near[0]
        return np.unique(np.concatenate([*near, rest]))
    surfaces, x = join([body, *obstacles])
    n = len(body.vertices)
    marked = np.zeros(len(x), dtype=np.bool_)
    edges, triangles = surfaces.edges, surfaces.triangles
    own_edge, own_triangle = edges[:, 0] < n, triangles[:, 0] < n
    for mine, theirs in ((own_edge, ~own_triangle), (~own_edge, own_triangle)):
        mark_passing(edges[mine], triangles[theirs], x, marked)
    found = np.flatnonzero(marked[:n])
    if found.size:
        return found
    for part in obstacles:
        turns = winding(body.vertices[0], part.vertices, part.triangles)
        if abs(turns) > 0.5 and _closed(part):
            return np.zeros(1, dtype=np.int64)
    return found


def within(one: Part, other: Part) -> IndexArray:
    """Return the vertices of `other` that are in triangles, segments or points closer to those of `one` than the radii.

    One of both has a radius, which has no triangles. One that lies within a closed surface counts as close.
    """
    if not one.radius:
        return np.arange(len(other.vertices)) if within(other, one).size else np.zeros(0, dtype=np.int64)
    marked = np.zeros(len(other.vertices), dtype=np.bool_)
    own = one.segments if len(one.segments) else np.zeros((1, 2), dtype=np.int64)
    sets = np.concatenate([other.triangles, other.segments[:, [0, 1, 1]]])
    if not len(sets):
        sets = np.arange(len(other.vertices))[:, None].repeat(3, axis=1)
    kernels.mark_within(own, one.vertices, sets, other.vertices, one.radius + other.radius, marked)
    if not marked.any() and len(other.triangles) and _closed(other):
        marked[0] = abs(winding(one.vertices[0], other.vertices, other.triangles)) > 0.5
    return np.flatnonzero(marked)


def winding(p: FloatArray, x: FloatArray, triangles: IndexArray) -> float:
    """Return how often a closed surface winds about point p: 1 inside, 0 outside [VanOosteromStrackee1983]."""
    a, b, c = (x[triangles[:, k]] - p for k in range(3))
    la, lb, lc = (np.linalg.norm(way, axis=1) for way in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    cosines = la * lb * lc + (a * b).sum(axis=1) * lc + (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return float(np.arctan2(volume, cosines).sum() / (2.0 * np.pi))


def _closed(part: Part) -> bool:
    surfaces, _ = join([part])
    return bool((surfaces.faces[:, 1] >= 0).all())


THIN = 1e-6
"""Share of the contact distance by which an edge must reach through a triangle of its own body to pass through it."""


def check_itself(body: Part, distance: float) -> None:
    """Raise SceneError that names vertices where `body`, if it touches itself, passes through itself.

    `distance`: of contact [m].
    """
    if not body.self_contact or not len(body.triangles):
        return
    surfaces, x = join([body])
    marked = np.zeros(len(x), dtype=np.bool_)
    mark_passing(surfaces.edges, surfaces.triangles, x, marked, THIN * distance)
    if marked.any():
        raise SceneError(
            f"nodes {names_of(np.flatnonzero(marked))} of the body pass through the body itself at the "
            "start, and lifting does not separate them; change its shape, or set contact.self_contact = "
            "false"
        )


def near_itself(body: Part, distance: float, name: str = "the body") -> tuple[str, ...]:
    """Return what users should know of `body`, called `name`, where it begins nearer to itself than `distance` [m]."""
    if not body.self_contact:
        return ()
    (surfaces, x), found = join([body]), ContactSet()
    Detector(surfaces, x, distance, distance).near(x, found)
    if not found.count:
        return ()
    weights, vertices = found.arrays.weight[: found.count], found.arrays.vertex[: found.count]
    gaps = np.linalg.norm(np.einsum("ck,cki->ci", weights, x[vertices]), axis=1)
    nodes = np.unique(vertices[weights != 0])
    return (
        (
            f"nodes {names_of(nodes)} of {name} begin nearer to other parts of it than "
            f"contact.contact_distance, {distance:g} m; the nearest are {gaps.min():.3g} m away. Contact "
            "pushes them apart at once; make contact.contact_distance smaller"
        ),
    )


def check_start(body: Part, obstacles: list[Part], name: str = "the body") -> None:
    """Raise SceneError that names the vertices of `body`, called `name`, that pass through an obstacle."""
    for i, obstacle in enumerate(obstacles):
        bad = passing(body, [obstacle])
        if bad.size:
            raise SceneError(
                f"nodes {names_of(bad)} of {name} pass through obstacles.{i} or lie inside of it at the start; move "
                "one of them, or set contact.start = 'lift'"
            )


def check_apart(name: str, body: Part, others: list[tuple[str, Part]]) -> None:
    """Raise SceneError where `body`, called `name`, passes through another soft body, each given with its name."""
    for other_name, other in others:
        bad = passing(body, [other])
        if bad.size or passing(other, [body]).size:
            where = f"nodes {names_of(bad)} of " if bad.size else ""
            raise SceneError(
                f"{where}{name} and {other_name} pass through each other at the start; move one of them, tie them, or "
                "set contact.start = 'lift'"
            )


def lift(
    body: Part, obstacles: list[Part], up: FloatArray, distance: float, name: str = "the body"
) -> FloatArray:
    """Return a move along `up` [m], shape (3,), after which `body` passes through no obstacle; zero if it does not now.

    Args:
        body, obstacles: Surfaces.
        up: Unit vector.
        distance: Contact distance [m]: the move exceeds what is needed by at most so much.
        name: Of the body, for messages.

    Raises:
        SceneError: no lift suffices: the body is inside of what holds it on all sides.
    """

    def clear(height: float) -> bool:
        here = replace(body, vertices=body.vertices + height * up)
        return not passing(here, obstacles).size

    return height_that_frees(clear, distance, f"{name} from what it passes through") * up


def height_that_frees(clear: Callable[[float], bool], distance: float, whom: str) -> float:
    """Return a height [m] at which a body is `clear`, too high by at most `distance` [m]; 0 if it is where it is.

    Raises:
        SceneError: there is none; `whom` it should free.
    """
    if clear(0.0):
        return 0.0
    high = distance
    for _ in range(MOST_LIFTS):
        if clear(high):
            break
        high *= 2.0
    else:
        raise SceneError(f"contact.start is 'lift', but lifting does not free {whom}; move one of them")
    low = 0.0 if high == distance else 0.5 * high
    while high - low > distance:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if clear(middle) else (middle, high)
    return high + distance
