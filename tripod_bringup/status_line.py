"""The status line of `tripod up`: what the whole chain does, in one line. Pure."""

from dataclasses import dataclass

CONTROL = {
    "STOP": "stopped: nothing moves the robot",
    "TELEOP": "moved by hand",
    "IK": "moved by the inverse kinematics",
    "REPLAY": "moved by a script",
}
"""Who moves the robot, by the name of the control mode."""


@dataclass(frozen=True)
class ChainStatus:
    """The newest that each node said; None where it said nothing yet.

    Attributes:
        mode: Name of the control mode.
        sim_state: Name of the simulation's state.
        real_time_factor: Simulated over wall time.
        step_time: Median wall time of a step [s].
        ik_state: Name of the state of the inverse kinematics.
        ik_error: Distance from effector to target [m]; None unless it is tracking.
        robot_state: Name of the driver's state.
        packets: Packets sent to the servos.
        note: What somebody complains about, empty if nothing.
    """

    mode: str | None = None
    sim_state: str | None = None
    real_time_factor: float | None = None
    step_time: float | None = None
    ik_state: str | None = None
    ik_error: float | None = None
    robot_state: str | None = None
    packets: int | None = None
    note: str = ""


def status_line(status: ChainStatus) -> str:
    """Return the line: who moves the robot, real-time factor, step time, IK error, robot state, packets, complaint."""
    parts = [CONTROL.get(status.mode or "", f"control {status.mode or '-'}")]
    factor = "-" if status.real_time_factor is None else f"{status.real_time_factor:.2f}x"
    step = "-" if status.step_time is None else f"{status.step_time * 1e3:.2f} ms"
    parts.append(f"sim {_lower(status.sim_state)} {factor}, step {step}")
    error = "" if status.ik_error is None else f" {status.ik_error * 1e3:.2f} mm"
    parts.append(f"ik {_lower(status.ik_state)}{error}")
    packets = "" if status.packets is None else f", {status.packets} packets"
    parts.append(f"robot {_lower(status.robot_state)}{packets}")
    if status.note:
        parts.append(status.note)
    return " | ".join(parts)


def _lower(name: str | None) -> str:
    return "-" if name is None else name.lower().replace("_", " ")
