"""Measured data from a recording of ours: what the servos were told, the measured pose of the disc, or its IMU."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tripod_graph import names
from tripod_host.arrays import FloatArray
from tripod_identify.csv_columns import Channel
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured, checked
from tripod_identify.observe import has_disc
from tripod_record.bag import Bag
from tripod_record.table import Series, read_series
from tripod_sim.scene import Scene

STILL = 1.0
"""A pose counts as at rest once its commands have stood for so long [s]."""

RARE = 3.0
"""Commands that are as rare by themselves have gaps where they are farther apart than so many times the usual."""

STEADY = 1e-3
"""Commands that differ by less are the same [rad, m]."""

COMMANDS = (names.ROBOT_JOINT_STATES, names.SIM_JOINT_STATES)
SEEN = (names.ROBOT_EFFECTOR_POSE, names.ROBOT_IMU)


def read_recording(path: Path, scene: Scene, *, poses: bool) -> Measured:
    """Return what a recording holds for a scene.

    Commands are those of `robot/joint_states`, where there are none `sim/joint_states`; measured are
    `robot/effector_pose`, and where there is none the orientation of `robot/imu`.

    Args:
        path: An .mcap file, or the directory of a recording.
        scene: That it shall be compared with.
        poses: Take the mean of what was measured at the end of each stand of the commands as a pose at rest.

    Raises:
        DataError, RecordError: it has no commands or nothing measured, is of another robot, or cannot be read.
    """
    bag = Bag(path)
    with bag.accounted():
        measured = _measured(bag, path, scene, poses=poses)
    left = bag.left_out()
    return replace(measured, notes=(*measured.notes, left)) if left else measured


def _measured(bag: Bag, path: Path, scene: Scene, *, poses: bool) -> Measured:
    wanted = [*COMMANDS, *SEEN]
    series = read_series(bag, lambda topic: any(topic.endswith(f"/{name}") for name in wanted))
    commands = _one(series, COMMANDS, path, "commands")
    seen = _one(series, SEEN, path, "measured pose")
    if not has_disc(scene):
        raise DataError(
            f"scene {scene.name!r} has no effector that is a disc, but {path} contains its pose; take the scene "
            "of that robot"
        )
    count = scene.servos.count if scene.servos else 0
    known = {n.removeprefix("position.") for n in commands.values if n.startswith("position.")}
    own = names.servo_names(count)
    if not count or set(own) - known or known - {*own, names.SLIDE}:
        raise DataError(
            f"{path} has commands for {', '.join(sorted(known)) or 'no joints'}; scene {scene.name!r} has "
            f"{', '.join(own) or 'no servos'}: does the recording belong to another robot?"
        )
    joints = [commands.values[f"position.{name}"] for name in (*own, names.SLIDE) if name in known]
    values, channels = _channels(seen)
    during = (seen.times >= commands.times[0]) & (seen.times <= commands.times[-1])
    inside = during & ~_in_gap(commands.times, seen.times)
    if not inside.any():
        raise DataError(
            f"{path} contains no measurement at a time when commands were given; record both together"
        )
    missed = np.count_nonzero(during & ~inside)
    notes = (f"{missed} rows are left out, because commands are missing there",) if missed else ()
    times, values = seen.times[inside], values[inside]
    at = np.column_stack([np.interp(times, commands.times, column) for column in joints])
    slide = at[:, count] if names.SLIDE in known else None
    whole = Measured(times, at[:, :count], slide, channels, values)
    found = checked(_stands(whole, path) if poses else whole, scene, range(1, len(values) + 1))
    return replace(found, notes=(*notes, *found.notes))


def _in_gap(commands: FloatArray, times: FloatArray) -> NDArray[np.bool_]:
    """Return which of `times` lie where nothing was commanded for long, as while a driver is started again."""
    gaps = np.diff(commands, append=commands[-1])
    longest = max(STILL, RARE * float(np.median(gaps)))
    return gaps[np.clip(np.searchsorted(commands, times, side="right") - 1, 0, len(gaps) - 1)] > longest


def _one(series: dict[str, Series], topics: tuple[str, ...], path: Path, what: str) -> Series:
    """Return the first of some topics that a recording has, of one robot."""
    for name in topics:
        found = [topic for topic in series if topic.endswith(f"/{name}")]
        if len(found) > 1:
            raise DataError(f"{path} contains several robots: {', '.join(found)}; record one alone")
        if found:
            return series[found[0]]
    raise DataError(f"{path} contains no {what}: none of {', '.join(topics)}")


def _channels(seen: Series) -> tuple[FloatArray, tuple[Channel, ...]]:
    """Return what was measured [m, rad], shape (k, m), and what its columns are."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import

    pose = "pose.position.x" in seen.values
    place = [seen.values[f"pose.position.{axis}"] for axis in "xyz"] if pose else []
    path = "pose.orientation" if pose else "orientation"
    quaternions = np.column_stack([seen.values[f"{path}.{axis}"] for axis in "xyzw"])
    norms = np.linalg.norm(quaternions, axis=1)
    vectors = np.full((len(norms), 3), np.nan)
    known = np.isfinite(norms) & (norms > 0.5)
    vectors[known] = Rotation.from_quat(quaternions[known]).as_rotvec()
    channels = [Channel("effector", axis) for axis in range(len(place))]
    channels += [Channel("effector", axis, angle=True) for axis in range(3)]
    return np.column_stack([*place, vectors]), tuple(channels)


def _stands(measured: Measured, path: Path) -> Measured:
    """Return one row for each stand of the commands: the mean of its last half."""
    assert measured.times is not None
    assert measured.commands is not None
    slide = measured.slide if measured.slide is not None else np.zeros(len(measured.values))
    joints = np.column_stack([measured.commands, slide])
    rows, first = [], 0
    for k in range(1, len(joints) + 1):
        if k < len(joints) and np.abs(joints[k] - joints[first]).max() < STEADY:
            continue
        if measured.times[k - 1] - measured.times[first] >= STILL:
            half = 0.5 * (measured.times[first] + measured.times[k - 1])
            late = np.flatnonzero(measured.times[first:k] >= half) + first
            rows.append((joints[k - 1], _mean(measured.values[late])))
        first = k
    if not rows:
        raise DataError(
            f"{path}: the commands never stand still for {STILL:g} s, so it contains no pose at rest; "
            "hold each pose longer"
        )
    stood = np.array([r[0] for r in rows])
    return Measured(
        None, stood[:, :-1], stood[:, -1] if measured.slide is not None else None, measured.channels,
        np.array([r[1] for r in rows]),
    )  # fmt: skip


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of each column of (k, m), NaN where nothing was measured."""
    some = np.isfinite(values)
    count = some.sum(axis=0)
    return np.where(count > 0, np.where(some, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)
