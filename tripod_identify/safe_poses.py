"""Poses to measure a robot in: spread over the range of its servos, each of them decided by its angles alone.

A pose serves where the model comes to rest at the same place from the pose before it and from the flat piece. Elsewhere
a robot may snap on its way, or be in either of two places, and its measured pose says little of its values.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tripod_identify.columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.model import Rest
from tripod_sim.errors import StepError
from tripod_sim.scene import Scene

FloatArray = NDArray[np.float64]

MARGIN = 0.1
"""Kept from the ends of the servos' ranges [rad]: nobody knows yet where exactly they stand."""

SPREAD = 0.35
"""By which each servo stands beside the common angle, at most [rad]: the disc tilts, but not far."""

SAME = 1e-4
"""Two ways to a pose lead to the same one if they end so close to each other [m]."""

TRIED = 4
"""Poses that are tried for each that is wanted, before it is given up."""

FEWEST, MOST = 4, 200
"""Poses that may be asked for."""


def safe_poses(
    scene: Scene,
    lower: Sequence[float],
    upper: Sequence[float],
    count: int,
    progress: Callable[[float], None] | None = None,
) -> FloatArray:
    """Return angles [rad], shape (count, s), in an order with short ways; always the same for the same arguments.

    Args:
        scene: The robot; its slide is where it stands.
        lower: Smallest angle that may be sent to each servo [rad], shape (s,).
        upper: Largest, shape (s,).
        count: How many.
        progress: Told the share that is done.

    Raises:
        DataError: another number of poses or servos than can be, no range that both scene and servos have, or fewer
            poses that serve.
        SceneError: the scene has no states of rest.
    """
    if not FEWEST <= count <= MOST:
        raise DataError(f"--poses is {count}; allowed: {FEWEST} to {MOST}")
    servos = scene.servos
    if servos is None or servos.count != len(lower):
        has = servos.count if servos else 0
        raise DataError(f"scene {scene.name!r} has {has} servos; the calibration is of {len(lower)}")
    low = np.maximum(lower, servos.angle_min) + MARGIN
    high = np.minimum(upper, servos.angle_max) - MARGIN
    if not (low < high).all():
        i = int(np.argmin(high - low))
        raise DataError(
            f"servo_{i} may be sent {lower[i]:g} to {upper[i]:g} rad and the scene has {servos.angle_min:g} to "
            f"{servos.angle_max:g} rad: less than {2 * MARGIN:g} rad of it is common"
        )
    rest = Rest(scene, Measured(None, None, None, (Channel("effector", 2),), np.zeros((1, 1))), ())
    flat = rest.start()
    rest.settle(flat, np.array([*np.clip(0.0, low, high), servos.slide]))
    before = flat.copy()
    found: list[FloatArray] = []
    for angles in _ordered(_spread(low, high, TRIED * count), count):
        ends = [before.copy(), flat.copy()]
        try:
            for state in ends:
                rest.settle(state, np.array([*angles, servos.slide]))
        except StepError:
            continue  # no rest there
        if np.linalg.norm(ends[0].centres[0] - ends[1].centres[0]) > SAME:
            continue
        found.append(angles)
        before = ends[0]
        if progress:
            progress(min(len(found), count) / count)
        if len(found) == count:
            return np.array(found)
    raise DataError(
        f"only {len(found)} of {TRIED * count} poses of scene {scene.name!r} are the same whichever way one comes; "
        f"ask for fewer: --poses {max(len(found), FEWEST)}"
    )


def _spread(low: FloatArray, high: FloatArray, count: int) -> FloatArray:
    """Return angles within the range, shape (count, s): a common one and what each servo stands beside it."""
    from scipy.stats import qmc  # noqa: PLC0415 - slow to import

    share = qmc.Halton(len(low) + 1, seed=1).random(count)
    angles = high + share[:, :1] * (low - high) + SPREAD * (2 * share[:, 1:] - 1)
    return np.asarray(np.clip(angles, low, high))


def _ordered(angles: FloatArray, count: int) -> FloatArray:
    """Return the first `count` in an order in which each is the nearest to the one before, the others behind them."""
    left = list(angles[:count])
    here, found = np.zeros(angles.shape[1]), []
    while left:
        here = left.pop(int(np.argmin([np.abs(pose - here).max() for pose in left])))
        found.append(here)
    return np.array([*found, *angles[count:]])
