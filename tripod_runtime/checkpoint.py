"""A state of a simulation as bytes, from which it goes on with the same bits."""

import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.simulation import Simulation
from tripod_sim.state import State

LARGEST = 10**9
"""Of a checkpoint [bytes]."""


UNREADABLE = (EOFError, KeyError, OSError, TypeError, ValueError, zipfile.BadZipFile)
"""What numpy raises for bytes that are no npz file of these arrays."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Where a simulation dropped what it kept from earlier steps, so that the next depends on this alone.

    Attributes:
        epoch: How often it had been reset.
        state: With the number of the step.
        efforts: Of the servos [N m], shape (s,).
    """

    epoch: int
    state: State
    efforts: FloatArray


def checkpoint_bytes(checkpoint: Checkpoint) -> bytes:
    """Return a checkpoint as an npz file, without pickled objects."""
    file = io.BytesIO()
    numbers: dict[str, Any] = {"epoch": checkpoint.epoch, "torques": checkpoint.efforts}
    for name, owner, field in _leaves(checkpoint.state):
        numbers[f"state.{name}"] = getattr(owner, field)
    np.savez(file, **numbers)
    return file.getvalue()


def read_checkpoint(data: bytes, simulation: Simulation) -> Checkpoint:
    """Return a checkpoint of a simulation of the same scene, for `Simulation.restore`.

    Raises SceneError if it is none, or of another scene.
    """
    state = simulation.state.copy()
    try:
        with np.load(io.BytesIO(data[:LARGEST]), allow_pickle=False) as numbers:
            for name, owner, field in _leaves(state):
                own = getattr(owner, field)
                if np.size(own) == 0 and f"state.{name}" not in numbers:
                    continue  # checkpoints of earlier versions lack arrays without entries
                value = numbers[f"state.{name}"]
                if isinstance(own, np.ndarray):
                    if value.shape != own.shape:
                        raise SceneError(
                            f"the checkpoint is of another scene: {name} has shape {value.shape}, here {own.shape}; "
                            "load the scene with which it was made"
                        )
                    own[:] = value
                else:
                    setattr(owner, field, type(own)(value.item()))
            epoch, torques = int(numbers["epoch"]), np.array(numbers["torques"], dtype=float)
    except UNREADABLE as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(
            f"the checkpoint is not of this scene: {error}; load the scene with which it was made"
        ) from None
    if torques.shape != simulation.efforts.shape:
        raise SceneError(
            f"the checkpoint is of another scene: it has {torques.size} torques, here "
            f"{simulation.efforts.size}; load the scene with which it was made"
        )
    return Checkpoint(epoch, state, torques)


def checkpoint_place(data: bytes) -> tuple[int, int]:
    """Return epoch and step of a checkpoint. Raises SceneError if it is none."""
    try:
        with np.load(io.BytesIO(data[:LARGEST]), allow_pickle=False) as numbers:
            return int(numbers["epoch"]), int(numbers["state.step"])
    except UNREADABLE as error:
        raise SceneError(f"not a checkpoint: {error}") from None


def _leaves(owner: Any, path: str = "") -> Iterator[tuple[str, Any, str]]:
    """Yield dotted name, owner and field of every array and number in a tree of dataclasses."""
    for field in fields(owner):
        value, name = getattr(owner, field.name), f"{path}{field.name}"
        if is_dataclass(value):
            yield from _leaves(value, f"{name}.")
        elif value is not None:
            assert isinstance(value, np.ndarray | int | float | IntEnum), (
                f"{name} is a {type(value).__name__}"
            )
            yield name, owner, field.name
