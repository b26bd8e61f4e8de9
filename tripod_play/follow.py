"""A path through inverse kinematics: servo angles for each key point, in time that the servos can keep.

Every key point is solved to the end on the quasi-static model, from the one before, so that all lie on one branch;
between them the angles go on straight lines. A stretch for which a servo would be too slow is given more time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel
from tripod_ik.solvable import nothing_to_solve
from tripod_ik.tasks import PositionTask, Task, orientation_tasks
from tripod_play.errors import PlayError
from tripod_play.path_file import KeyPoints, Kind
from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import effector_of, joints_of

FINEST = 0.02
"""Largest change of the tilt between two solved points [rad]; longer stretches are divided."""

NOTICED = 0.01
"""Delay of the beginning that is worth a word [s]."""

FINEST_MOVE = 0.001
"""The same for positions [m]."""


@dataclass(frozen=True)
class Limit:
    """A place where the path had to give way.

    Attributes:
        begin, end: Of the stretch, in the time of the file [s].
        why: In words.
    """

    begin: float
    end: float
    why: str

    def __str__(self) -> str:
        return f"{self.begin:.3g} to {self.end:.3g} s: {self.why}"


@dataclass(frozen=True, eq=False)
class ServoPath:
    """What the servos are to do.

    Attributes:
        times: Rising from 0 [s], shape (n,).
        angles: Commands [rad, m, N, Pa], shape (n, s).
        file_times: Time of the file at each point [s], shape (n,).
        limits: Where the path was slowed down, or is out of reach.
    """

    times: FloatArray
    angles: FloatArray
    file_times: FloatArray
    limits: tuple[Limit, ...]

    def at(self, time: float) -> FloatArray:
        """Return the angles at `time` [s], shape (s,)."""
        return np.array([np.interp(time, self.times, a) for a in self.angles.T])


def servo_path(
    scene: Scene, points: KeyPoints, speed: float, *, progress: Callable[[float], None] | None = None
) -> ServoPath:
    """Return the servo path of key points.

    Args:
        scene: Of the robot; its servos' start is where the path begins.
        points: The path.
        speed: Of the servos that is counted on [rad/s]; of other actuators in spans, see `tripod_ik.state`.
        progress: Called with the finished fraction.

    Raises:
        PlayError: the scene has no actuators, the path is of tilts and the effector has none, or inverse
            kinematics fails at a key point.
        SceneError, StepError: the model cannot be built.
    """
    servos, why = joints_of(scene), nothing_to_solve(scene)
    if servos is None or why:
        raise PlayError(why)
    effector = effector_of(scene)
    if points.kind is Kind.TILT and effector and not effector.is_disc:
        raise PlayError(
            f"the path is of tilts, but the effector of scene {scene.name!r} is a point or a set, which has no "
            "orientation; take a path of positions"
        )
    if not 0 < speed < np.inf:
        raise PlayError(f"the speed of the servos is {speed} rad/s; it must be above 0")
    spans = servos.spans
    start = servos.start[:-1] / spans
    model = StaticModel(replace(scene, ball=None), servos.slide, start)
    solver = InverseSolver(model, AngleLimit(servos.low / spans, servos.high / spans), tolerance=1e-5)
    height = float(model.state().equilibrium[2])
    times, values = _refined(points)
    angles: list[FloatArray] = []
    limits: list[Limit] = []
    far = 0.0
    for i, (time, value) in enumerate(zip(times.tolist(), values, strict=True)):
        solution = solver.solve(_tasks(points.kind, value, height))
        if solution.outcome in (Outcome.FAILED, Outcome.UNFINISHED):
            raise PlayError(f"inverse kinematics found no solution at {time:g} s: {solution.reason}")
        if solution.outcome is Outcome.CLOSEST:
            far = max(far, solution.residual)
            begin = limits.pop().begin if i and limits and limits[-1].end == times[i - 1] else time
            limits.append(
                Limit(
                    begin,
                    time,
                    f"the path is out of reach by up to {1000.0 * far:.3g} mm; the closest poses are used",
                )
            )
        else:
            far = 0.0
        angles.append(model.angles)
        if progress:
            progress((i + 1) / len(times))
    paced = _paced(times, np.array(angles), start, speed, limits, [a.name for a in servos.actuators])
    return replace(paced, angles=paced.angles * spans)


def _tasks(kind: Kind, value: FloatArray, height: float) -> Sequence[Task]:
    """Return what inverse kinematics is to do at one point of a path."""
    return orientation_tasks(_normal(value), height) if kind is Kind.TILT else (PositionTask(value),)


def _normal(tilt: FloatArray) -> FloatArray:
    """Return the normal of a plate turned by the rotation vector (tilt_x, tilt_y, 0), shape (3,)."""
    x, y = tilt.tolist()
    angle = float(np.hypot(x, y))
    s = np.sin(angle) / angle if angle else 1.0
    return np.array([s * y, -s * x, np.cos(angle)])


def _refined(points: KeyPoints) -> tuple[FloatArray, FloatArray]:
    """Return times and values with long stretches divided."""
    finest = FINEST if points.kind is Kind.TILT else FINEST_MOVE
    times, values = [points.times[0]], [points.values[0]]
    for k in range(1, len(points.times)):
        way = points.values[k] - points.values[k - 1]
        parts = max(1, int(np.ceil(np.abs(way).max() / finest)))
        for j in range(1, parts + 1):
            times.append(points.times[k - 1] + (points.times[k] - points.times[k - 1]) * j / parts)
            values.append(points.values[k - 1] + way * j / parts)
    return np.array(times), np.array(values)


def _paced(
    times: FloatArray,
    angles: FloatArray,
    start: FloatArray,
    speed: float,
    limits: list[Limit],
    names: Sequence[str],
) -> ServoPath:
    """Return the path from the start angles, slowed down where a servo is too slow; neighbouring places are one."""
    if times[0] > 0:
        times, angles = np.append(0.0, times), np.vstack([start, angles])
    else:
        lead = float(np.abs(angles[0] - start).max()) / speed
        if lead > 0:
            if lead > NOTICED:
                limits.append(Limit(0.0, 0.0, f"begins {lead:.3g} s late: the robot first goes to its start"))
            times, angles = np.append(-lead, times), np.vstack([start, angles])
    spans, moves = np.diff(times), np.abs(np.diff(angles, axis=0))
    needed = moves.max(axis=1) / speed
    slow = needed > spans * (1 + 1e-9)
    k = 0
    while k < len(spans):
        if not slow[k]:
            k += 1
            continue
        first = k
        while k < len(spans) and slow[k]:
            k += 1
        slowest = int(moves[first:k].max(axis=0).argmax())
        fastest = float((moves[first:k, slowest] / spans[first:k]).max())
        factor = float(needed[first:k].sum() / spans[first:k].sum())
        limits.append(
            Limit(
                max(float(times[first]), 0.0),
                float(times[k]),
                f"slowed {factor:.3g} times: {names[slowest]} would need {fastest:.3g} rad/s, it has {speed:g}",
            )
        )
    paced = np.append(0.0, np.cumsum(np.maximum(spans, needed)))
    return ServoPath(paced, angles, times, tuple(sorted(limits, key=lambda x: x.begin)))
