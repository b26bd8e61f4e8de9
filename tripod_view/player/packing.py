"""Arrays as text for a browser: bytes one behind the other, compressed, in base64, and where each begins. Pure."""

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_view.player.camera import camera
from tripod_view.player.colour_maps import MAPS
from tripod_view.player.film import Arrows, Film

KINDS = {"u1": "<u1", "u2": "<u2", "u4": "<u4", "f4": "<f4", "f8": "<f8"}
"""Of numbers, as the player names them."""

CODES = 254
"""Into which the range of a field in some pictures is divided; 255 is the code of a value that is missing."""

STEPS = 16383
"""Into which the box about a body is divided in each picture: positions are right to half of one."""


PLACES, PARTS = 4095, 1023
"""Into which the box about the arrows of a group is divided, and the longest of them."""

SHORT = 0.01
"""Length of an arrow, over that of the longest, below which it is never drawn."""


class Packer:
    """Gathers arrays."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def add(self, array: NDArray[Any], kind: str) -> list[Any]:
        """Add an array; return what the player needs to find it: kind, first byte, count of numbers."""
        self._bytes += b"\0" * (-len(self._bytes) % 8)
        entry = [kind, len(self._bytes), int(array.size)]
        self._bytes += np.ascontiguousarray(array, dtype=KINDS[kind]).tobytes()
        return entry

    def text(self) -> str:
        """Return all of it: zlib's format in base64."""
        return base64.b64encode(zlib.compress(bytes(self._bytes), 6)).decode("ascii")


def stage(film: Film) -> dict[str, Any]:
    """Return what stays the same in all pictures, as JSON takes it."""
    packer, view = Packer(), camera(film)
    return {
        "title": film.title,
        "description": film.description,
        "source": film.source,
        "camera": {
            "centre": view.centre,
            "radius": view.radius,
            "azimuth": view.azimuth,
            "elevation": view.elevation,
            "follow": view.follow,
            "floor": view.floor,
        },
        "bodies": [
            {
                "name": body.name,
                "colour": body.colour,
                "nodes": body.positions.shape[1],
                "seen": seen,
                "through": body.through,
                "fields": [{"name": f.name, "unit": f.unit, "signed": f.signed} for f in body.fields],
                "triangles": packer.add(body.triangles, "u4"),
                "edges": packer.add(edges(body.triangles), "u4"),
            }
            for body, seen in zip(film.bodies, view.seen, strict=True)
        ],
        "pieces": [
            {
                "name": piece.name,
                "colour": piece.colour,
                "moves": piece.poses is not None,
                "vertices": packer.add(piece.vertices, "f4"),
                "triangles": packer.add(piece.triangles, "u4"),
            }
            for piece in film.pieces
        ],
        "arrows": [
            {"name": a.name, "unit": a.unit, "colour": a.colour, "longest": longest(a)} for a in film.arrows
        ],
        "maps": MAPS,
        "colouring": _colouring(film),
        "curves": [
            {"title": c.title, "unit": c.unit, "names": c.names, "limits": c.limits} for c in film.curves
        ],
        "data": packer.text(),
    }


def reel(film: Film) -> dict[str, Any]:
    """Return the pictures of a film, as JSON takes them: positions in steps of their box, each as the difference to the
    picture before, poses, curves, events.
    """
    packer = Packer()
    bodies = []
    for body in film.bodies:
        low = (
            body.positions.min(axis=1, initial=np.inf)
            if body.positions.shape[1]
            else np.zeros((len(film.times), 3))
        )
        high = body.positions.max(axis=1, initial=-np.inf) if body.positions.shape[1] else low
        step = (high - low) / STEPS
        whole = np.rint((body.positions - low[:, None]) / np.where(step > 0, step, 1.0)[:, None]).astype(
            np.uint16
        )
        bodies.append(
            {
                "low": packer.add(low, "f8"),
                "step": packer.add(step, "f8"),
                "positions": packer.add(_smooth(whole), "u1"),
                "fields": [_coded(packer, field.values) for field in body.fields],
            }
        )
    return {
        "times": packer.add(film.times, "f8"),
        "bodies": bodies,
        "poses": [packer.add(p.poses, "f8") for p in film.pieces if p.poses is not None],
        "arrows": [_packed_arrows(packer, a) for a in film.arrows],
        "curves": [packer.add(c.values, "f4") for c in film.curves],
        "events": [[e.time, e.text] for e in film.events],
        "data": packer.text(),
    }


def _colouring(film: Film) -> dict[str, Any] | None:
    """Return by which field, and in which limits, the player colours at first; limits None: those of each picture."""
    chosen = film.colouring
    if not (chosen and film.field(chosen.name)):
        return None
    limits = chosen.limits or (film.limits(chosen.name) if len(film.times) > 1 else None)
    return {"name": chosen.name, "limits": limits if limits and limits[0] < limits[1] else None}


def _smooth(whole: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Return whole numbers of each picture, shape (k, ...), so that those of a smooth motion are packed well.

    They are second differences in time, the signs in the lowest bits, all low bytes before all high ones. Sums wrap.
    """
    found = whole.copy()
    for first in (1, 2):
        found[first:] -= found[first - 1 : -1].copy()
    return _folded(found.view(np.int16))


def _folded(signed: NDArray[np.int16]) -> NDArray[np.uint8]:
    """Return whole numbers, the signs in the lowest bits, all low bytes before all high ones."""
    folded = ((signed << 1) ^ (signed >> 15)).view(np.uint16)
    return np.concatenate([(folded & 255).ravel(), (folded >> 8).ravel()]).astype(np.uint8)


def _coded(packer: Packer, values: FloatArray) -> dict[str, Any]:
    """Return where the player finds a field: codes 0 to `CODES` of its range, as differences to the picture before."""
    finite = np.isfinite(values)
    low, high = (
        (float(end) for end in (values[finite].min(), values[finite].max())) if finite.any() else (0.0, 0.0)
    )
    step = (high - low) / CODES
    codes = np.full(values.shape, CODES + 1, np.uint8)
    codes[finite] = np.rint((values[finite] - low) / step).astype(np.uint8) if step > 0 else 0
    codes[1:] -= codes[:-1].copy()  # wraps, as it does in the player
    return {"low": low, "step": step, "codes": packer.add(codes, "u1")}


def _packed_arrows(packer: Packer, arrows: Arrows) -> dict[str, Any]:
    """Return where the player finds arrows: points in steps of their box, vectors in parts of the longest, both as
    differences to the arrow of the same number in the picture before. Arrows too short to be drawn are left out.
    """
    longest_one = longest(arrows)
    long = np.linalg.norm(arrows.vectors, axis=1) > SHORT * longest_one
    picture = np.repeat(np.arange(len(arrows.counts)), arrows.counts)[long]
    points, vectors = arrows.points[long], arrows.vectors[long]
    counts = np.bincount(picture, minlength=len(arrows.counts))
    low = points.min(axis=0) if len(points) else np.zeros(3)
    step = (points.max(axis=0) - low) / PLACES if len(points) else np.zeros(3)
    whole = np.concatenate(
        [
            np.rint((points - low) / np.where(step > 0, step, 1.0)),
            np.rint(vectors * (PARTS / (longest_one or 1.0))),
        ],
        axis=1,
    ).astype(np.int16)
    ends = np.cumsum(counts)
    number = np.arange(len(whole)) - (ends - counts)[picture]
    has = (picture > 0) & (number < counts[picture - 1])
    change = whole.copy()
    change[has] -= whole[(ends - counts)[picture[has] - 1] + number[has]]
    return {
        "counts": packer.add(counts, "u4"),
        "low": packer.add(low, "f8"),
        "step": packer.add(step, "f8"),
        "part": longest_one / PARTS,
        "rows": packer.add(_folded(change.T), "u1"),
        "longest": longest_one,
    }


def longest(arrows: Arrows) -> float:
    """Return the length of the longest of some arrows, 0 without any."""
    return float(np.linalg.norm(arrows.vectors, axis=1).max(initial=0.0))


def edges(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges of triangles, each once, shape (e, 2)."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(sides, axis=0) if len(sides) else sides
