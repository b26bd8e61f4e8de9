"""Single pictures of a film, drawn without a browser or a graphics card. Looks like the player's."""

import math

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray, IndexArray
from tripod_view.player.camera import Camera, camera
from tripod_view.player.colour_scale import scale_of
from tripod_view.player.film import Deforming, Field, Film, Rgb
from tripod_view.player.packing import longest
from tripod_view.player.picture_kernels import draw_lines, fill_triangles
from tripod_view.player.shapes import Shape, disc

HALF_ANGLE = 0.3
"""Half the angle of view [rad]."""

THROUGH = 0.35
"""How much is seen of what is inside others."""

FINER = 2
"""Points of a side for each that is shown."""

MARGIN = 8
"""Of the legend, from the corner [points]."""

ARROW, THICK = 0.4, 0.012
"""Length of the longest arrow of a group over the radius of the scene, and thickness of all, as in `view.js`."""

HEAD, WIDE, FACES = 5.0, 2.2, 10
"""Length and width of the head of an arrow over its thickness, and faces of it."""

MARK = ((4.0, 9.0, 255.0), (5.5, 7.5, 17.0))
"""Rings about the largest value: radii [points] and brightness, as in `view.js`."""

SAME = 1e-3
"""Values that differ by less than that part are one: the mark does not jump between places that are alike."""

LINES = (30.0, 40.0, 50.0)
"""Colour of lines on bodies."""

SKY, GROUND_HAZE, GRID, SHADOW = (244, 247, 250), (221, 228, 234), (120.0, 135.0, 150.0), 0.87


class Painter:
    """Draws pictures of one film.

    Attributes:
        size: Columns and rows of a picture.
    """

    def __init__(self, film: Film, size: tuple[int, int] = (640, 480)) -> None:
        self._film, self.size, self._view = film, size, camera(film)
        self._eye_axes = _axes(self._view)
        self._grid = _grid(self._view)
        columns, rows = FINER * size[0], FINER * size[1]
        share = np.linspace(0, 1, rows)[:, None, None]
        self._scale = scale_of(film)
        self._legend = self._scale.legend() if self._scale else None
        self._largest: tuple[int, int] | None = None
        self._sky = np.broadcast_to((1 - share) * SKY + share * GROUND_HAZE, (rows, columns, 3)).copy()

    def picture(self, k: int) -> NDArray[np.uint8]:
        """Return picture k, shape (rows, columns, 3)."""
        image = self._sky.copy()
        depth = np.zeros(image.shape[:2])
        centre = self._centre(k)
        shapes = self._shapes(k)
        grid, lines = self._grid
        cell = np.abs(grid[2, 0] - grid[0, 0]) or 1.0
        moved = np.array([*np.rint((centre - self._view.centre)[:2] / cell) * cell, 0.0])
        draw_lines(self._seen(grid + moved, centre), lines, np.array(GRID), 0.35, image, depth)
        self._shadows(shapes, centre, image)
        for vertices, triangles, colours in shapes:
            if len(triangles):
                shades = self._light(vertices, triangles, centre)[:, None, None] * colours
                fill_triangles(self._seen(vertices, centre), triangles, shades, image, depth)
        for body in self._film.bodies:
            if len(body.lines):
                seen = self._seen(body.positions[k], centre)
                draw_lines(seen, body.lines, np.array(LINES), 0.5, image, depth)
            if body.through:
                whole, near = image.copy(), np.zeros(image.shape[:2])
                shades = np.full((len(body.triangles), 1, 3), body.colour, float)
                fill_triangles(self._seen(body.positions[k], centre), body.triangles, shades, whole, near)
                image += THROUGH * (whole - image)
        in_front = np.zeros_like(depth)  # arrows are seen through all else
        for vertices, triangles, colour in self._arrows(k):
            shades = self._light(vertices, triangles, centre)[:, None, None] * np.array(colour, float)
            fill_triangles(self._seen(vertices, centre), triangles, shades, image, in_front)
        self._mark(k, centre, image)
        smaller = image.reshape(self.size[1], FINER, self.size[0], FINER, 3).mean(axis=(1, 3))
        picture = np.clip(np.rint(smaller), 0, 255).astype(np.uint8)
        if self._legend is not None:
            rows, columns = self._legend.shape[:2]
            picture[MARGIN : MARGIN + rows, MARGIN : MARGIN + columns] = self._legend
        return picture

    def _centre(self, k: int) -> FloatArray:
        """Return what is looked at; it goes along with bodies that go far."""
        centre = np.array(self._view.centre)
        if self._view.follow and self._film.bodies:
            positions = self._film.bodies[0].positions
            centre += positions[k].mean(axis=0) - positions[0].mean(axis=0)
        return centre

    def _shapes(self, k: int) -> list[tuple[FloatArray, IndexArray, FloatArray]]:
        """Return vertices in the world, triangles and their colours of all that is there in picture k."""
        found = [(body.positions[k], body.triangles, self._colours(body, k)) for body in self._film.bodies]
        for piece in self._film.pieces:
            vertices = piece.vertices
            if piece.poses is not None:
                pose = piece.poses[k]
                if not np.isfinite(pose).all():
                    continue
                axis, w = pose[3:6], pose[6]
                turned = 2 * np.cross(axis, vertices)
                vertices = vertices + w * turned + np.cross(axis, turned) + pose[:3]
            found.append((vertices, piece.triangles, np.array(piece.colour, float)[None, None]))
        return found

    def _colours(self, body: Deforming, k: int) -> FloatArray:
        """Return the colour of a body, shape (1, 1, 3), or of the corners of its triangles, shape (m, 3, 3)."""
        field = self._field(body)
        if not (self._scale and field):
            return np.array(body.colour, float)[None, None]
        return self._scale.colours(field.values[k])[body.triangles]

    def _mark(self, k: int, centre: FloatArray, image: FloatArray) -> None:
        """Draw a ring about the largest value of the surfaces, of signed values the one farthest from 0."""
        sizes = dict[tuple[int, int], float]()
        for b, body in enumerate(self._film.bodies):
            if (field := self._field(body)) is None:
                continue
            values = np.abs(field.values[k]) if field.signed else field.values[k]
            corners = np.unique(body.triangles)
            corners = corners[np.isfinite(values[corners])]
            if len(corners):
                node = int(corners[values[corners].argmax()])
                sizes[b, node] = float(values[node])
            if self._largest and self._largest[0] == b:
                sizes[self._largest] = float(values[self._largest[1]])
        if not sizes:
            return
        best = max(sizes, key=lambda place: np.nan_to_num(sizes[place], nan=-np.inf))
        if not (self._largest and sizes.get(self._largest, -np.inf) >= (1 - SAME) * sizes[best]):
            self._largest = best
        b, node = self._largest
        column, row, near = self._seen(self._film.bodies[b].positions[k][node : node + 1], centre)[0]
        if near <= 0:
            return
        reach = math.ceil(FINER * MARK[0][1])
        left, top = max(0, int(column) - reach), max(0, int(row) - reach)
        part = image[top : max(0, int(row) + reach + 2), left : max(0, int(column) + reach + 2)]
        rows, columns = np.ogrid[top : top + part.shape[0], left : left + part.shape[1]]
        far = np.hypot(columns - column, rows - row) / FINER
        for inner, outer, brightness in MARK:
            part[(far >= inner) & (far <= outer)] = brightness

    def _field(self, body: Deforming) -> Field | None:
        """Return the field that colours a body, None where it has none."""
        return next((f for f in body.fields if self._scale and f.name == self._scale.name), None)

    def _arrows(self, k: int) -> list[tuple[FloatArray, IndexArray, Rgb]]:
        """Return vertices in the world, triangles and colour of the arrows of each group in picture k."""
        found, thick = [], THICK * self._view.radius
        for arrows in self._film.arrows:
            own = slice(*(int(arrows.counts[:end].sum()) for end in (k, k + 1)))
            scale = ARROW * self._view.radius / (longest(arrows) or 1.0)
            vectors = scale * arrows.vectors[own]
            seen = np.linalg.norm(vectors, axis=1) > 0.5 * thick
            if seen.any():
                found.append((*_arrow_shapes(arrows.points[own][seen], vectors[seen], thick), arrows.colour))
        return found

    def _seen(self, vertices: FloatArray, centre: FloatArray) -> FloatArray:
        """Return column, row and 1 / distance of `vertices`, shape (n, 3)."""
        back, right, up = self._eye_axes
        columns, rows = FINER * self.size[0], FINER * self.size[1]
        from_centre = vertices - centre
        away = self._distance - from_centre @ back
        inverse = np.where(away > 0.02 * self._distance, 1 / np.where(away == 0, 1, away), 0.0)
        scale = 0.5 * rows / math.tan(HALF_ANGLE)
        column = 0.5 * columns + scale * (from_centre @ right) * inverse
        row = 0.5 * rows - scale * (from_centre @ up) * inverse
        return np.stack([column, row, inverse], axis=1)

    @property
    def _distance(self) -> float:
        aspect = self.size[0] / self.size[1]
        return self._view.radius / math.sin(HALF_ANGLE) / min(1.0, aspect)

    def _light(self, vertices: FloatArray, triangles: IndexArray, centre: FloatArray) -> FloatArray:
        """Return how bright each triangle is, seen from either side."""
        a, b, c = (vertices[triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        eye = centre + self._distance * self._eye_axes[0]
        normal *= np.sign(((eye - a) * normal).sum(axis=1))[:, None]
        light = 0.52 + 0.16 * normal[:, 2]
        for strength, direction in ((0.40, (0.6, -0.3, 1.0)), (0.12, (-0.6, 0.7, 0.3))):
            light += strength * np.maximum(normal @ (np.array(direction) / np.linalg.norm(direction)), 0)
        return np.asarray(light)

    def _shadows(
        self, shapes: list[tuple[FloatArray, IndexArray, FloatArray]], centre: FloatArray, image: FloatArray
    ) -> None:
        """Darken the ground under all shapes."""
        floor = self._view.floor
        if centre[2] + self._distance * self._eye_axes[0][2] <= floor:
            return
        mask, depth = np.ones_like(image), np.zeros(image.shape[:2])
        for vertices, triangles, _ in shapes:
            if len(triangles):
                height = np.maximum(vertices[:, 2] - floor, 0.0)
                flat = np.stack(
                    [
                        vertices[:, 0] - 0.15 * height,
                        vertices[:, 1] + 0.075 * height,
                        np.full(len(vertices), floor),
                    ],
                    axis=1,
                )
                fill_triangles(
                    self._seen(flat, centre), triangles, np.full((len(triangles), 1, 3), SHADOW), mask, depth
                )
        image *= mask


def _arrow_shapes(points: FloatArray, vectors: FloatArray, thick: float) -> Shape:
    """Return arrows from `points` along `vectors`, both of shape (k, 3) [m], their shafts of radius `thick` [m]."""
    length = np.linalg.norm(vectors, axis=1)
    along = vectors / length[:, None]
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    frames = np.stack([across, np.cross(along, across), along], axis=1)
    head, (unit, triangles) = np.minimum(length, HEAD * thick)[:, None], disc(1.0, 1.0, FACES)
    upper, rim = unit[:, 2] > 0, thick * unit[:, :2]
    start, neck, end = np.zeros((len(points), 1)), length[:, None] - head, length[:, None]
    shaft = _placed(points, frames, rim, np.where(upper, neck, start))
    tip = _placed(points, frames, WIDE * rim * ~upper[:, None], np.where(upper, end, neck))
    every = np.arange(2 * len(points))[:, None, None] * len(unit) + triangles
    return np.concatenate([shaft, tip]), every.reshape(-1, 3)


def _placed(points: FloatArray, frames: FloatArray, aside: FloatArray, along: FloatArray) -> FloatArray:
    """Return what is `aside` (v, 2) and `along` (k, v) in each frame (k, 3, 3) at `points` (k, 3), shape (k v, 3)."""
    local = np.concatenate([np.broadcast_to(aside, (*along.shape, 2)), along[:, :, None]], axis=2)
    return np.asarray(points[:, None] + local @ frames).reshape(-1, 3)


def _axes(view: Camera) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the directions back to the eye, right and up."""
    a, e = math.radians(view.azimuth), math.radians(view.elevation)
    back = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
    right = np.array([-math.sin(a), math.cos(a), 0.0])
    return back, right, np.cross(back, right)


def _grid(view: Camera) -> tuple[FloatArray, IndexArray]:
    """Return ends and lines of the squares on the ground."""
    power = 10.0 ** math.floor(math.log10(view.radius))
    cell = power * (1.0 if view.radius / power > 4 else 0.2)
    count = math.ceil(2.5 * view.radius / cell)
    x, y = (round(c / cell) * cell for c in view.centre[:2])
    ticks, reach = cell * np.arange(-count, count + 1), cell * count
    pieces = np.linspace(-reach, reach, 9)
    along = [[[x + t, y + p, view.floor] for p in pieces] for t in ticks]
    across = [[[x + p, y + t, view.floor] for p in pieces] for t in ticks]
    ends = np.array(along + across)
    k = np.arange(ends.size // 3).reshape(ends.shape[:2])
    lines = np.stack([k[:, :-1].ravel(), k[:, 1:].ravel()], axis=1)
    return ends.reshape(-1, 3), lines
