"""Arrays as text for a browser: bytes one behind the other, compressed, in base64, and where each begins. Pure."""

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_view.player.camera import camera
from tripod_view.player.film import Film

KINDS = {"u2": "<u2", "u4": "<u4", "f4": "<f4", "f8": "<f8"}
"""Of numbers, as the player names them."""

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
            }
        )
    return {
        "times": packer.add(film.times, "f8"),
        "bodies": bodies,
        "poses": [packer.add(p.poses, "f8") for p in film.pieces if p.poses is not None],
        "curves": [packer.add(c.values, "f4") for c in film.curves],
        "events": [[e.time, e.text] for e in film.events],
        "data": packer.text(),
    }


def edges(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges of triangles, each once, shape (e, 2)."""
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(sides, axis=0) if len(sides) else sides
