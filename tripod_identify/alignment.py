"""Taking away how the frame of the data lies: nothing, a translation, or a rotation and a translation."""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import rotation_vector
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.observe import best_rotation

KINDS = ("none", "translation", "rigid")


@dataclass(frozen=True, eq=False)
class Aligned:
    """Predicted numbers in the frame of the data.

    Attributes:
        values: Shape (k, m).
        shift: [m], shape (3,).
        turn: Rotation vector [rad], shape (3,).
    """

    values: FloatArray
    shift: FloatArray
    turn: FloatArray


def align(predicted: FloatArray, measured: FloatArray, channels: tuple[Channel, ...], kind: str) -> Aligned:
    """Return `predicted` moved as a whole so that the positions fit best; orientations stay as they are.

    Args:
        predicted, measured: [m, rad], shape (k, m); the latter NaN where there is none.
        channels: What the columns are.
        kind: One of `KINDS`. `translation` takes the mean difference away along each axis.

    Raises:
        DataError: another kind, or `rigid` with fewer than three places.
    """
    shift, turn, out = np.zeros(3), np.zeros(3), predicted.copy()
    if kind not in KINDS:
        raise DataError(f"--align is {kind!r}; allowed: {', '.join(KINDS)}")
    if kind == "rigid":
        before, after, groups = _places(predicted, measured, channels)
        if len(before) < 3:
            raise DataError(
                f"--align rigid needs three measured positions with x, y and z; the data have {len(before)}"
            )
        R = best_rotation(before - before.mean(axis=0), after - after.mean(axis=0))
        turn, shift = rotation_vector(R), after.mean(axis=0) - R @ before.mean(axis=0)
        for group in groups:
            out[:, group] = predicted[:, group] @ R.T + shift
    elif kind == "translation":
        for axis in range(3):
            own = [j for j, c in enumerate(channels) if c.axis == axis and not c.angle]
            if own and np.isfinite(measured[:, own]).any():
                shift[axis] = np.nanmean(measured[:, own] - predicted[:, own])
                out[:, own] += shift[axis]
    return Aligned(out, shift, turn)


def position_groups(channels: tuple[Channel, ...]) -> dict[str, list[int]]:
    """Return the columns of the place of each source, x before y before z."""
    groups: dict[str, list[int]] = {}
    for j in sorted(range(len(channels)), key=lambda j: channels[j].axis):
        if not channels[j].angle:
            groups.setdefault(channels[j].source, []).append(j)
    return groups


def _places(
    predicted: FloatArray, measured: FloatArray, channels: tuple[Channel, ...]
) -> tuple[FloatArray, FloatArray, list[list[int]]]:
    """Return all places of which x, y and z were measured, twice, shape (n, 3), and the columns of such sources."""
    groups = [g for g in position_groups(channels).values() if len(g) == 3]
    before, after = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for group in groups:
        whole = np.isfinite(measured[:, group]).all(axis=1)
        before.append(predicted[whole][:, group])
        after.append(measured[whole][:, group])
    return np.concatenate(before), np.concatenate(after), groups
