"""Keeps trained bases on disk, so that a scene trains once. Files live here, and nowhere else in `reduced`.

A file holds a SHA-256 digest of its name and numbers, then the numbers alone: how many there must be follows from the
scene. A file that is not so is not read, whatever else it is.
"""

import hashlib
import os
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tripod_host.reading import read_file
from tripod_host.writing import replaced
from tripod_sim.build import Parts
from tripod_sim.reduced.basis import Basis, free_rows
from tripod_sim.reduced.coordinates import BODY
from tripod_sim.reduced.train import train
from tripod_sim.reduced.training import training_scene
from tripod_sim.scene import Scene
from tripod_sim.system import System

FloatArray = NDArray[np.float64]

VERSION = 1
"""Of training and of what a basis means; counts up when either changes."""

MOST = 64
"""Files that are kept; the oldest go."""

DIGEST = 32

_recent: dict[str, Basis] = {}


def stored_basis(scene: Scene, full: Parts) -> Basis:
    """Return the basis of `scene`, with `reduced`, from the cache, or trained and kept there.

    Args:
        scene: What is reduced.
        full: What `build` makes of the scene without `reduced`.

    Raises:
        SceneError: the training cannot be made as the scene asks.
    """
    name = key(scene, full)
    if name not in _recent:
        path = folder()
        file = path / f"{name}.basis" if path else None
        basis = read(file, name, scene, full) if file else None
        if basis is None:
            note = _Note(scene.name)
            basis = train(scene, note.progress)
            note.done(file if file and write(file, name, basis) else None)
        remember(name, basis)
    return _recent[name]


def remember(name: str, basis: Basis) -> None:
    """Let `basis` serve in this process wherever a scene has the key `name`; the last four are remembered."""
    while len(_recent) >= 4:
        _recent.pop(next(iter(_recent)))
    _recent[name] = basis


def key(scene: Scene, full: Parts) -> str:
    """Return a name of all that a basis depends on."""
    digest = hashlib.sha256(f"{VERSION} {training_scene(scene)!r} {scene.reduced!r}".encode())
    digest.update(np.ascontiguousarray(full.mesh.nodes).tobytes())
    digest.update(np.ascontiguousarray(full.mesh.elements).tobytes())
    return digest.hexdigest()


def folder() -> Path | None:
    """Return where bases are kept: `tripod` in the user's cache directory; None where there is no home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tripod" / "reduced"
    except RuntimeError:
        return None


def read(file: Path, name: str, scene: Scene, full: Parts) -> Basis | None:
    """Return what `write` wrote for `name`; None where there is none or it is damaged."""
    shapes = _shapes(scene, full)
    count = sum(rows * columns for rows, columns in shapes)
    try:
        data = read_file(file, DIGEST + 8 * count)
    except OSError:
        return None
    if len(data) != DIGEST + 8 * count or data[:DIGEST] != _digest(name, data[DIGEST:]):
        return None
    numbers = np.frombuffer(data, dtype="<f8", offset=DIGEST)
    if not np.isfinite(numbers).all():
        return None
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    lift, modes, weights, reached = (
        part.reshape(shape).copy() for part, shape in zip(np.split(numbers, ends[:-1]), shapes, strict=True)
    )
    if not ((weights >= 0).all() and weights.any()):
        return None
    return Basis(lift, modes, weights[0], float(reached[0, 0]))


def write(file: Path, name: str, basis: Basis) -> bool:
    """Keep `basis` and return whether that was possible."""
    parts = (basis.lift, basis.shapes, basis.weights, np.array([basis.reached]))
    data = b"".join(np.ascontiguousarray(part, dtype="<f8").tobytes() for part in parts)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with replaced(file) as new:
            new.write(_digest(name, data) + data)
        files = sorted(file.parent.glob("*.basis"), key=lambda f: f.stat().st_mtime_ns)
        for old in files[:-MOST]:
            old.unlink(missing_ok=True)
    except OSError:
        return False
    return True


def _digest(name: str, data: bytes) -> bytes:
    return hashlib.sha256(name.encode() + data).digest()


def _shapes(scene: Scene, full: Parts) -> tuple[tuple[int, int], ...]:
    """Return the shapes of lift, shapes, weights and share of poses."""
    assert isinstance(full.system, System)
    assert scene.reduced
    groups = full.system.groups
    free, servos = len(free_rows(groups)), len(groups.driven)
    boundary = BODY * len(groups.rigid) + 2 * servos + 1
    elements = len(full.system.solid.elements)
    return (free, boundary), (free, scene.reduced.modes), (1, elements), (1, 1)


class _Note:
    """Tells the user what takes long, once it does."""

    SOON = 1.0
    """[s]."""

    def __init__(self, name: str) -> None:
        self._name, self._begin, self._told = name, time.monotonic(), False

    def progress(self, part: float) -> None:
        """Tell, if it has taken long."""
        taken = time.monotonic() - self._begin
        if not self._told and taken > self.SOON and part > 0:
            self._told = True
            whole = taken / part
            print(
                f"scene {self._name!r}: training the reduced model, about {whole:.0f} s, once for these settings ...",
                file=sys.stderr, flush=True,
            )  # fmt: skip

    def done(self, file: Path | None) -> None:
        """Tell the end of what was told."""
        if self._told:
            kept = f"kept in {file}" if file else "not kept: no cache directory can be written"
            print(
                f"reduced model: {time.monotonic() - self._begin:.1f} s, {kept}", file=sys.stderr, flush=True
            )
