"""Poses to measure a robot in: safe ones, and of these those that tell most.

Safe is a pose that its angles alone decide: the model comes to rest at the same place from the pose before it, from the
flat piece and from the lowest pose, also with arms that stand `MARGIN` beyond or short of it. Elsewhere a robot may
snap on its way, or be in either of two places (strips that are pushed inwards while they are flat buckle up or down),
and where it is says little.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.fit import USUAL
from tripod_identify.measured import Measured
from tripod_identify.model import Rest, plainly
from tripod_identify.parameters import parameters
from tripod_identify.problem import Solved, rest_jacobian
from tripod_identify.propose import most_telling
from tripod_sim.errors import StepError
from tripod_sim.scene import Scene
from tripod_sim.state import State

VALUES = ("servos.zero", "servos.slide", "material.young")
"""What is looked for besides how the sensor sits."""


@dataclass(frozen=True)
class Look:
    """What a sensor measures of a pose, and what nobody knows of it.

    Attributes:
        channels: What it measures.
        sits: How it sits: names as of `parameters`.
        align: What may be between its frame and the world besides.
    """

    channels: tuple[Channel, ...]
    sits: tuple[str, ...]
    align: str = "none"

    @property
    def names(self) -> tuple[str, ...]:
        """All that is looked for."""
        return (*VALUES, *self.sits)

    @property
    def columns(self) -> tuple[str, ...]:
        """Of a file of measured poses, with units."""
        return tuple(f"{c.label}_{'deg' if c.angle else 'mm'}" for c in self.channels)


LOOKS = {
    "heights": Look((Channel("effector", 2),), ("frame.z",)),
    "imu": Look((Channel("effector", 0, True), Channel("effector", 1, True)), ("frame.rx", "frame.ry")),
    "marker": Look(tuple(Channel("effector", axis) for axis in range(3)), ("mount",), "rigid"),
}
"""Sensors that can measure poses: a ruler, the IMU on the disc, a camera that sees a marker on it."""

RULER = 5e-4
"""To which somebody knows the slide [m]. Poses alone hardly tell it from what all servos stand off by."""

MARGIN = 0.1
"""Kept from the ends of the servos' ranges [rad]: nobody knows yet where exactly they stand."""

SPREAD = 0.5
"""By which each servo stands beside the common angle, at most [rad]: the disc tilts, but not far."""

SAME = 1e-4
"""Two ways to a pose lead to the same one if they end so close to each other [m]."""

MORE = 4
"""Poses to choose from, over those that are wanted."""

FEWEST, MOST = 8, 200
"""Poses that may be asked for."""


def telling_poses(
    scene: Scene,
    look: Look,
    lower: Sequence[float],
    upper: Sequence[float],
    count: int,
    progress: Callable[[float], None] | None = None,
) -> FloatArray:
    """Return angles [rad], shape (count, s), in an order with short ways; always the same for the same arguments.

    Args:
        scene: The robot; its slide is where it stands.
        look: What is measured.
        lower: Smallest angle that may be sent to each servo [rad], shape (s,).
        upper: Largest, shape (s,).
        count: How many.
        progress: Told the share that is done.

    Raises:
        DataError: another number of poses or servos than can be, no range that both scene and servos have, or fewer
            poses that are safe.
        SceneError, StepError: the scene has no states of rest.
    """
    low, high = allowed(scene, lower, upper, count)
    rest = Rest(scene, Measured(None, None, None, look.channels, np.zeros((1, len(look.channels)))), ())
    poses, states = _safe(scene, rest, _spread(low, high, MORE * count), progress)
    if len(poses) < count:
        raise DataError(
            f"only {len(poses)} of {MORE * count} poses of scene {scene.name!r} are the same from "
            f"wherever the robot comes; request fewer: --poses {max(len(poses), FEWEST)}"
        )
    wanted = parameters(scene, look.names, align=look.align)
    data = Measured(None, poses, None, look.channels, np.zeros((len(poses), len(look.channels))))
    base = plainly(scene)
    here = Solved(base, np.array([rest.observer.see(state, base.sensor) for state in states]), rest, states)
    u = np.array([p.to_u(p.value) for p in wanted])
    sigma = np.array([USUAL[c.angle] for c in look.channels])
    jacobians = rest_jacobian(here, wanted, u, base, data, ()) / sigma[:, None]
    known = [RULER / p.plausible if p.name == "servos.slide" else p.width for p in wanted]
    plausible = np.diag(np.array(known) ** -2.0)
    return _ordered(poses[[i for i, _ in most_telling(list(jacobians), plausible, count)]])


def allowed(
    scene: Scene, lower: Sequence[float], upper: Sequence[float], count: int
) -> tuple[FloatArray, FloatArray]:
    """Return smallest and largest angles [rad], shape (s,), of `count` poses. Raises DataError as `telling_poses`."""
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
            f"servo_{i} may be sent {lower[i]:g} to {upper[i]:g} rad and the scene allows "
            f"{servos.angle_min:g} to {servos.angle_max:g} rad: the common range is less than "
            f"{2 * MARGIN:g} rad; change servos.angle_min and servos.angle_max, or calibrate again"
        )
    return low, high


def _safe(
    scene: Scene, rest: Rest, angles: FloatArray, progress: Callable[[float], None] | None
) -> tuple[FloatArray, tuple[State, ...]]:
    """Return the angles, shape (k, s), at which the model is at one place, whichever way it comes, and its states."""
    servos = scene.servos
    assert servos
    flat = rest.start()
    zero = float(np.clip(0.0, servos.angle_min, servos.angle_max))
    rest.settle(flat, np.array([*[zero] * servos.count, servos.slide]))
    deep = flat.copy()
    for part in np.linspace(0.0, 1.0, 5)[1:]:
        rest.settle(deep, np.array([*(part * angles.min(axis=0)), servos.slide]))
    before = flat
    poses: list[FloatArray] = []
    states: list[State] = []
    for k, pose in enumerate(_ordered(angles)):
        signs = 1 - 2 * ((k >> np.arange(servos.count)) & 1)  # other ones from pose to pose
        end: State | None = None
        for off in (MARGIN, -MARGIN, 0.0):
            end = _one_place(rest, (before, flat, deep), np.array([*(pose + off * signs), servos.slide]))
            if end is None:
                break
        if end is not None:
            poses.append(pose)
            states.append(end)
            before = end
        if progress:
            progress((k + 1) / len(angles))
    return np.array(poses).reshape(-1, angles.shape[1]), tuple(states)


def _one_place(rest: Rest, starts: Sequence[State], joints: FloatArray) -> State | None:
    """Return the state of rest at `joints`; None where there is none, or one comes to another from another start."""
    ends = [start.copy() for start in starts]
    try:
        for state in ends:
            rest.settle(state, joints)
    except StepError:
        return None
    same = all(np.linalg.norm(state.centres[0] - ends[0].centres[0]) <= SAME for state in ends)
    return ends[0] if same else None


def _spread(low: FloatArray, high: FloatArray, count: int) -> FloatArray:
    """Return angles within the range, shape (count, s): a common one and what each servo stands beside it."""
    from scipy.stats import qmc  # noqa: PLC0415 - slow to import

    share = qmc.Halton(len(low) + 1, seed=1).random(count)
    angles = high + share[:, :1] * (low - high) + SPREAD * (2 * share[:, 1:] - 1)
    return np.asarray(np.clip(angles, low, high))


def _ordered(angles: FloatArray) -> FloatArray:
    """Return the same in an order in which each is the nearest to the one before."""
    left = list(angles)
    here = np.zeros(angles.shape[1])
    found: list[FloatArray] = []
    while left:
        here = left.pop(int(np.argmin([np.abs(pose - here).max() for pose in left])))
        found.append(here)
    return np.array(found)
