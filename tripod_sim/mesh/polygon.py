"""A polygon into triangles: from its first corner where that is right, else by clipping ears [Meisters1975]."""

from collections.abc import Sequence
from itertools import pairwise

Point = tuple[float, float, float]

MOST_CORNERS = 300
"""Of a polygon that is not convex: clipping ears takes a time that grows like the cube of the corners."""

FLAT = 1e-13
"""Twice the area of a triangle over that of its polygon, up to which it has none."""


def triangulate(corners: Sequence[Point]) -> list[tuple[int, int, int]] | None:
    """Return a polygon's triangles, as places in `corners`, running round as it does; None if it is no simple one.

    A polygon without any area is divided from its first corner, too.
    """
    n = len(corners)
    fan = [(0, i, j) for i, j in pairwise(range(1, n))]
    if n == 3:
        return fan
    areas = [_cross(corners[a], corners[b], corners[c]) for a, b, c in fan]
    x, y, z = (sum(area[k] for area in areas) for k in range(3))  # Newell's normal
    square = x * x + y * y + z * z
    largest = max(area[0] ** 2 + area[1] ** 2 + area[2] ** 2 if _moderate(area) else 0.0 for area in areas)
    if not (square > 0.0 and square < float("inf")):
        return fan if largest == 0.0 else None
    shares = [(area[0] * x + area[1] * y + area[2] * z) / square for area in areas]
    if min(shares) > FLAT:
        return fan
    found = _clipped(corners, (x / square, y / square, z / square)) if n <= MOST_CORNERS else None
    return found or (fan if min(shares) > -FLAT else None)


def _moderate(v: Point) -> bool:
    return max(abs(c) for c in v) < 1e150


def _cross(a: Point, b: Point, c: Point) -> Point:
    """Return (b - a) x (c - a)."""
    u, v = [q - p for p, q in zip(a, b, strict=True)], [q - p for p, q in zip(a, c, strict=True)]
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def _clipped(corners: Sequence[Point], normal: Point) -> list[tuple[int, int, int]] | None:
    """Clip ears: corners that point outward, in whose triangle no other corner lies. None where there is none left."""

    def share(a: int, b: int, c: int) -> float:
        area = _cross(corners[a], corners[b], corners[c])
        return area[0] * normal[0] + area[1] * normal[1] + area[2] * normal[2]

    left, found = list(range(len(corners))), []
    while len(left) > 3:
        for k, b in enumerate(left):
            a, c = left[k - 1], left[(k + 1) % len(left)]
            if share(a, b, c) > FLAT and not any(
                share(a, b, p) >= -FLAT and share(b, c, p) >= -FLAT and share(c, a, p) >= -FLAT
                for p in left
                if p not in (a, b, c)
            ):
                found.append((a, b, c))
                del left[k]
                break
        else:
            return None
    a, b, c = left
    return [*found, (a, b, c)] if share(a, b, c) > FLAT else None
