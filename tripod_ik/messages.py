"""What the node reads from messages, and writes into them."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from trajectory_msgs.msg import JointTrajectory

from tripod_graph import names
from tripod_graph.joint import EFFORT_UNITS, POSITION_UNITS, Joint
from tripod_graph.trajectory import point_of
from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState
from tripod_sim.tables.joints import Actuator


def linear_state(message: Any) -> LinearState:
    """Return the state in a tripod_msgs/Compliance; raise IkError if it cannot be used."""
    if message.header.frame_id != names.WORLD:
        raise IkError(f"compliance in frame {message.header.frame_id!r}; the frame must be {names.WORLD!r}")
    joints = tuple(message.joint_names)
    if not joints or (not len(message.units) and joints != names.servo_names(len(joints))):
        raise IkError(
            f"compliance of joints {list(joints)} without units, which servo_0, servo_1 and so on alone may lack; an "
            "older recording has none: run its scene again"
        )
    rows, n = 6 + len(joints), len(joints)
    if len(message.w) != rows**2:
        raise IkError(f"compliance has {len(message.w)} entries; {n} joints give {rows**2}")
    p, q = message.effector.position, message.effector.orientation
    if len(message.units):
        for name, size in (("jacobian", 6 * n), ("stiffness", n * n)):
            if len(getattr(message, name)) != size:
                found = len(getattr(message, name))
                raise IkError(f"compliance has {found} entries of {name}; {n} joints give {size}")
        fields = (joints, message.units, message.lower, message.upper, message.effort_max, message.pulls)
        return LinearState.of_actuators(
            actuators_of(*(tuple(field) for field in fields)), commands=message.angles, efforts=message.efforts,
            effector=(p.x, p.y, p.z), rotation=(q.x, q.y, q.z, q.w),  # type: ignore[arg-type]
            equilibrium_offset=message.equilibrium_offset, W=np.reshape(message.w, (rows, rows)),
            jacobian=np.reshape(message.jacobian, (6, n)), stiffness=np.reshape(message.stiffness, (n, n)),
        )  # fmt: skip
    return LinearState(
        joint_names=joints,
        angles=message.angles,
        efforts=message.efforts,
        effector=(p.x, p.y, p.z),  # type: ignore[arg-type]
        rotation=(q.x, q.y, q.z, q.w),  # type: ignore[arg-type]
        equilibrium_offset=message.equilibrium_offset,
        W=[message.w[rows * i : rows * (i + 1)] for i in range(rows)],  # type: ignore[arg-type]
        stability_margin=message.stability_margin if len(message.stability_margin_slope) else 1.0,
        stability_margin_slope=message.stability_margin_slope,
    )


@lru_cache(maxsize=4)
def actuators_of(
    joints: tuple[str, ...],
    units: tuple[str, ...],
    lower: tuple[float, ...],
    upper: tuple[float, ...],
    effort_max: tuple[float, ...],
    pulls: tuple[bool, ...],
) -> tuple[Actuator, ...]:
    """Return the joints of a compliance, shape (n,) each; raise IkError where their fields do not fit together."""
    if not len(joints) == len(units) == len(lower) == len(upper) == len(effort_max) == len(pulls):
        raise IkError(
            f"compliance of {len(joints)} joints needs as many units, lower, upper, effort_max and pulls"
        )
    known = {**POSITION_UNITS, **EFFORT_UNITS}
    for name, unit, low, high, most in zip(joints, units, lower, upper, effort_max, strict=True):
        if unit not in known:
            raise IkError(f"compliance: {name} has the unit {unit!r}; it must be one of {', '.join(known)}")
        if not (-np.inf < low < high < np.inf and most > 0):
            raise IkError(
                f"compliance: {name} has the range {low:g} to {high:g} {unit}, effort up to {most:g}"
            )
    return tuple(
        Actuator(
            name, unit, low, high, low, unit in EFFORT_UNITS, most if most < np.inf else None, bool(pull)
        )
        for name, unit, low, high, most, pull in zip(
            joints, units, lower, upper, effort_max, pulls, strict=True
        )
    )


def trajectory(
    command: FloatArray, joints: Sequence[Joint], source: str, over: float = 0.0
) -> JointTrajectory:
    """Return the command of `joints` [rad, m, m³, N, Pa], shape (n,), by `source` as a trajectory: go there evenly
    within `over` [s], and no faster than your slew rate allows.
    """
    point = point_of(command, joints)
    point.time_from_start.nanosec = round(1e9 * over)
    message = JointTrajectory()
    message.header.frame_id = source
    message.joint_names = [joint.name for joint in joints]
    message.points = [point]
    return message


def point(position: FloatArray) -> Point:
    """Return a position [m], shape (3,), as a message."""
    x, y, z = (float(value) for value in position)
    return Point(x=x, y=y, z=z)
