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

STEPS = 65535
"""Into which the box about a body is divided in each picture: positions are right to half of one."""


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
        whole[1:] -= whole[:-1].copy()  # wraps, as it does in the player
        bodies.append(
            {
                "low": packer.add(low, "f8"),
                "step": packer.add(step, "f8"),
                "positions": packer.add(whole, "u2"),
                "fields": [_coded(packer, field.values) for field in body.fields],
            }
        )
    return {
        "times": packer.add(film.times, "f8"),
        "bodies": bodies,
        "poses": [packer.add(p.poses, "f8") for p in film.pieces if p.poses is not None],
        "arrows": [
            {
                "counts": packer.add(a.counts, "u4"),
                "points": packer.add(a.points, "f4"),
                "vectors": packer.add(a.vectors, "f4"),
                "longest": longest(a),
            }
            for a in film.arrows
        ],
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


def _coded(packer: Packer, values: FloatArray) -> dict[str, Any]:
    """Return the values of a field as codes 0 to `CODES` of their range, and where the player finds them."""
    finite = np.isfinite(values)
    low, high = (
        (float(end) for end in (values[finite].min(), values[finite].max())) if finite.any() else (0.0, 0.0)
    )
    step = (high - low) / CODES
    codes = np.full(values.shape, CODES + 1, np.uint8)
    codes[finite] = np.rint((values[finite] - low) / step).astype(np.uint8) if step > 0 else 0
    return {"low": low, "step": step, "codes": packer.add(codes, "u1")}


def longest(arrows: Arrows) -> float:
    """Return the length of the longest of some arrows, 0 without any."""
    return float(np.linalg.norm(arrows.vectors, axis=1).max(initial=0.0))


def edges(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges of triangles, each once, shape (e, 2)."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(sides, axis=0) if len(sides) else sides
