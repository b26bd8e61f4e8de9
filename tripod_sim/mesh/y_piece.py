"""Generator of the silicone Y, and of stars of more strips: a centre hole, one layer of graded hexahedra.

Each strip is one mapped grid. Its cross lines run from the arc of the hole over the arc of the effector disc and
the straight line through the inner corners, where neighbouring strips meet, to the clamp edge and the tip. Lines lie
densest at the disc and at the clamp edge, where the sheet bends most. Quadratic hexahedra follow the two arcs.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.elements.element import Element
from tripod_sim.elements.hexahedron import H8_MODES
from tripod_sim.errors import SceneError
from tripod_sim.mesh.solid_mesh import SolidMesh


@dataclass(frozen=True)
class YShape:
    """Dimensions of the piece [m]; the defaults are the public tutorial's.

    Attributes:
        thickness: Of the sheet.
        width: Of a strip.
        tip_radius: From the centre to the end of a strip.
        clamp_radius: From the centre to the edge of the clamped end.
        disc_radius: Of the rigid effector disc.
        hole_radius: Of the centre hole.
        legs: Number of strips, evenly about Z.
    """

    thickness: float = 0.005
    width: float = 0.030
    tip_radius: float = 0.055
    clamp_radius: float = 0.045
    disc_radius: float = 0.0075
    hole_radius: float = 0.005
    legs: int = 3

    def __post_init__(self) -> None:
        inner = self.width / 2 / np.tan(np.pi / self.legs)
        chain = (0.0, self.hole_radius, self.disc_radius, inner, self.clamp_radius, self.tip_radius)
        if not (all(a < b for a, b in pairwise(chain)) and self.thickness > 0):
            raise SceneError(
                "y_piece: these lengths must satisfy 0 < hole_radius < disc_radius < width / (2 tan(pi / "
                f"legs)) < clamp_radius < tip_radius and thickness > 0 [m]; got {self}"
            )


@dataclass(frozen=True)
class YLevel:
    """Resolution of the grid of one strip.

    Attributes:
        across: Elements over the width.
        inner: Elements from the disc to the line through the inner corners.
        along: Elements from there to the clamp edge.
        grading: Ratio of neighbouring element lengths along the strip; above 1 they shrink towards the clamp edge.
        layers: Elements through the thickness.
        clamped: Elements from the clamp edge to the tip, which only a compliant clamp strains.
        inner_grading: As `grading`, from the line through the inner corners towards the disc.
        clamped_grading: As `grading`, from the tip towards the clamp edge.
    """

    across: int
    inner: int
    along: int
    grading: float
    layers: int = 1
    clamped: int = 1
    inner_grading: float = 1.0
    clamped_grading: float = 1.0


def _self_similar(m: int) -> YLevel:
    """Return level 7 + m, in which the elements of level 8 outside of the disc are divided into m x m x m."""
    return YLevel(2 * m, m, 4 * m, 1.5 ** (1 / m), m, 2 * m, 1.5 ** (1 / m), 2 ** (1 / m))


LEVELS = {
    1: YLevel(2, 1, 5, 1.4),
    2: YLevel(2, 2, 7, 1.2),
    3: YLevel(6, 2, 7, 1.2),
    4: YLevel(8, 2, 8, 1.2),
    5: YLevel(2, 1, 4, 1.2, layers=2),
    6: YLevel(4, 1, 9, 1.1, layers=2),
    7: YLevel(5, 2, 10, 1.05, layers=3),
    **{7 + m: _self_similar(m) for m in (1, 2, 3, 4)},
    12: YLevel(2, 1, 6, 1.38, clamped=2, clamped_grading=2.25),
    13: YLevel(2, 1, 2, 2.25, clamped=2, clamped_grading=2.25),
    14: YLevel(4, 2, 4, 1.5, clamped=3, clamped_grading=1.6),
}
"""Mesh levels by number. The sheet bends along its strips: elements across matter least, those along most.
Finer meshes than 4 resolve the singular edge of the sharp clamp and leave the smooth branch in the working pose.
5 to 7 are for linear tetrahedra: 567, 1674 and 3096 coordinates, about the sizes of the workshop's meshes. They have
more layers, since along the sheet alone no refinement cures the locking of linear tetrahedra in bending.
8 to 11 resolve the compliant clamp, too; each divides the edges of level 8 by 1, 2, 3 or 4, which is what a study of
convergence needs. 12 for `h8_modes` and 13 for `h20` are graded for the effector's position with that clamp, by
benchmarks/graded_mesh.py: the fewest unknowns on its way that err by less than 1.25 and 1 %. No element of 12 is
shorter in the clamp than 3 mm: at 2.5 mm, half the thickness, the modes of `h8_modes` buckle where servos press the
clamp's edge. 14 halves the edges of 13 along the sheet."""


def divided(level: YLevel, m: int) -> YLevel:
    """Return the resolution with every element divided into m x m x m, at the same gradings over the whole."""
    return YLevel(
        m * level.across, m * level.inner, m * level.along, level.grading ** (1 / m), m * level.layers,
        m * level.clamped, level.inner_grading ** (1 / m), level.clamped_grading ** (1 / m),
    )  # fmt: skip


def y_piece(level: YLevel, shape: YShape | None = None, kind: Element = H8_MODES) -> SolidMesh:
    """Return the mesh of the piece, mid-plane at z = 0, strip i along azimuth 2 pi i / legs.

    Args:
        level: Resolution.
        shape: Dimensions; None takes the tutorial's.
        kind: Of the elements, hexahedra; the nodes between corners lie on the arcs of hole and disc, too.
    """
    shape = shape or YShape()
    order = 1 if kind.size == 8 else 2
    lines = _cross_lines(level, shape, order)  # (k, order across + 1, 2), strip 0
    n_lines, n_across = lines.shape[:2]
    plane: list[FloatArray] = []
    index = np.empty((shape.legs, n_lines, n_across), dtype=np.int64)
    shared = order * (1 + level.inner) + 1  # lines whose ends lie on the seam with the neighbouring strip
    for arm in range(shape.legs):
        c, s = np.cos(2 * np.pi * arm / shape.legs), np.sin(2 * np.pi * arm / shape.legs)
        turned = lines @ np.array([[c, s], [-s, c]])
        for k in range(n_lines):
            for j in range(n_across):
                if k < shared and j == 0 and arm > 0:
                    index[arm, k, j] = index[arm - 1, k, -1]
                elif k < shared and j == n_across - 1 and arm == shape.legs - 1:
                    index[arm, k, j] = index[0, k, 0]
                else:
                    index[arm, k, j] = len(plane)
                    plane.append(turned[k, j])
    flat = np.array(plane)
    levels = np.linspace(-shape.thickness / 2, shape.thickness / 2, order * level.layers + 1)
    nodes = np.concatenate([np.column_stack([flat, np.full(len(flat), z)]) for z in levels])
    steps = np.round((kind.reference + 1) / 2 * order).astype(int)
    cells = np.stack(
        [index[:, a : n_lines - order + a : order, b : n_across - order + b : order] for a, b, _ in steps],
        axis=-1,
    ).reshape(-1, kind.size)
    elements = np.concatenate([cells + len(flat) * (order * k + steps[:, 2]) for k in range(level.layers)])
    used, elements = np.unique(elements, return_inverse=True)  # H20 has no nodes in faces and cells
    return SolidMesh.of(nodes[used], elements.reshape(-1, kind.size), kind)


def _cross_lines(level: YLevel, shape: YShape, order: int) -> FloatArray:
    """Return the nodes of strip 0, line by line from the hole to the tip, shape (lines, order across + 1, 2) [m].

    With order 2, the nodes midway between corners as well.
    """
    t = np.linspace(-1, 1, order * level.across + 1)
    half = shape.width / 2
    corner = half / np.tan(np.pi / shape.legs)  # x of the inner corners

    def arc(radius: float) -> FloatArray:
        return radius * np.column_stack([np.cos(t * np.pi / shape.legs), np.sin(t * np.pi / shape.legs)])

    def cross(x: float) -> FloatArray:
        return np.column_stack([np.full_like(t, x), half * t])

    disc, first = arc(shape.disc_radius), cross(corner)
    lines = [arc(shape.hole_radius), disc]
    lines += [disc + (first - disc) * w for w in _graded(level.inner, 1 / level.inner_grading)]
    lines += [cross(corner + (shape.clamp_radius - corner) * w) for w in _graded(level.along, level.grading)]
    clamped = shape.tip_radius - shape.clamp_radius
    lines += [
        cross(shape.clamp_radius + clamped * w) for w in _graded(level.clamped, 1 / level.clamped_grading)
    ]
    if order == 1:
        return np.array(lines)
    return np.array([lines[0], *(x for a, b in pairwise(lines) for x in ((a + b) / 2, b))])


def _graded(count: int, ratio: float) -> FloatArray:
    """Return the ends of `count` elements that divide [0, 1], each shorter than the one before by `ratio`."""
    lengths = ratio ** -np.arange(count, dtype=float)
    ends = np.cumsum(lengths) / lengths.sum()
    ends[-1] = 1.0
    return ends
