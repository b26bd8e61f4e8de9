"""States of the other nodes in plain words, as lines of the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tripod_graph import diagnostic_keys as keys
from tripod_graph.authority import OperatorAuthority
from tripod_graph.mode import Mode
from tripod_graph.source import name_of

SILENT = 1.5
"""Age of the newest status after which a node counts as silent [s]; status comes at 10 Hz."""

SIMULATED = ("", "mock")
"""Ports behind which there is no robot."""

GRAVITY = 9.81
"""By which a load is a mass [m/s²]."""

PAUSED = 1
"""State of tripod_msgs/SimStatus."""

SLOW = 0.95
"""Share of the chosen speed below which the simulation counts as slow."""


class Light(Enum):
    """What a line's light says; its colour is the style sheet's."""

    GOOD = "good"
    WATCH = "watch"
    BAD = "bad"
    OFF = "off"


@dataclass(frozen=True)
class Line:
    """One line of the status list: a light, who it is about, and a sentence; plain text."""

    light: Light
    who: str
    text: str


class SimFields(Protocol):
    """What is read of tripod_msgs/SimStatus."""

    state: int
    message: str
    dt: float
    real_time_factor: float
    step_time_median: float

    time: float
    scene: str
    step_time_p99: float
    time_error: float
    effector_time_error: float


class IkFields(Protocol):
    """What is read of tripod_msgs/IkStatus."""

    state: int
    message: str
    error: float
    effector_mesh_error: float
    active_limits: Sequence[str]
    solver_status: str


class RobotFields(Protocol):
    """What is read of tripod_msgs/RobotStatus."""

    state: int
    message: str
    port: str
    joint_names: Sequence[str]
    packets_sent: int


def silence(who: str, age: float | None) -> Line | None:
    """Return the line for a node not heard for `age` [s] (None: never), None if its status is fresh."""
    if age is None:
        return Line(Light.OFF, who, "not heard yet")
    return Line(Light.BAD, who, f"silent for {age:.0f} s") if age > SILENT else None


def sim_line(status: SimFields, speed: float = 1.0) -> Line:
    """Return the line for a fresh status of the simulator that was asked for so many times real time."""
    factor = status.real_time_factor
    steps = f"{factor:.2f} x, step {1e3 * status.step_time_median:.2f} of {1e3 * status.dt:.0f} ms"
    slow, chosen = not factor >= SLOW * speed, "real time" if speed == 1.0 else f"the chosen {speed:g} x"
    texts = {
        0: (Light.WATCH, f"slower than {chosen}: {steps}") if slow else (Light.GOOD, f"{chosen}: {steps}"),
        PAUSED: (Light.WATCH, "paused"),
        2: (Light.WATCH, "holds: no commands come in"),
        3: (Light.GOOD, "parked (in the park pose, or on the way): waits for commands"),
        4: (Light.BAD, f"failed: {status.message or 'no reason given'}"),
    }
    return Line(*_stated("Simulator", status.state, texts))


def run_table(status: SimFields, robot: "RobotFields | None", speed: float = 1.0) -> dict[str, object]:
    """Return how a simulation runs, as the page has it.

    Args:
        status: Of the simulator.
        robot: Of the driver, None while it is not heard.
        speed: Chosen, simulated over real time; 0: as fast as it can.
    """
    return {
        "scene": status.scene,
        "state": status.state,
        "message": status.message,
        "time": round(status.time, 6),
        "factor": round(status.real_time_factor, 3),
        "speed": speed,
        "step": float(f"{status.step_time_median:.3g}"),
        "p99": float(f"{status.step_time_p99:.3g}"),
        "dt": status.dt,
        "time_error": _known(status.time_error),
        "effector_time_error": _known(status.effector_time_error),
        "simulated": not is_real(robot),
    }


def is_real(robot: "RobotFields | None") -> bool:
    """Return whether a robot is connected, by the status of the driver; None while that is not heard."""
    return robot is not None and robot.port not in SIMULATED and robot.state != 0


def _known(value: float) -> float | None:
    return float(f"{value:.3g}") if value >= 0 else None


def ik_line(status: IkFields) -> Line:
    """Return the line for a fresh status of the inverse kinematics."""
    off, limits = f"{1e3 * status.error:.2f} mm off", ", ".join(status.active_limits)
    if status.effector_mesh_error >= 0:
        off += f", mesh {1e3 * status.effector_mesh_error:.2g} mm (estimated)"
    texts = {
        0: (Light.OFF, "idle"),
        1: (Light.GOOD, f"following, {off}"),
        2: (Light.WATCH, f"target out of reach: {off}" + (f" (at limit: {limits})" if limits else "")),
        3: (Light.WATCH, "holds: no fresh data from the simulator"),
        5: (Light.WATCH, f"waits while a closer pose is searched, {off}"),
        4: (Light.BAD, f"solver failed: {status.message or status.solver_status}"),
    }
    return Line(*_stated("Inverse kinematics", status.state, texts))


def ik_value_lines(values: Mapping[str, str]) -> list[Line]:
    """Return the lines about the load and the expected error, where the inverse kinematics is asked for them.

    `values`: of its diagnostics.
    """
    lines = []
    if (load := values.get(keys.LOAD)) is not None:
        half, push = (_numbers(values.get(name, "")) for name in (keys.LOAD_HALF, keys.PUSH))
        lines.append(_load_line(_numbers(load), half, push))
    if (shift := values.get(keys.EXPECTED_ERROR)) is not None:
        lines.append(_expected_line(shift, values.get(keys.EXPECTED_ERROR_HALF, "")))
    return lines


def _load_line(force: list[float], half: list[float], push: list[float]) -> Line:
    """Return the line about a load on the effector [N], with half its 90 % interval, and a push along x and y [N]."""
    if len(force) != 1 or len(half) != 1:
        return Line(Light.OFF, "Load", "not told")
    if len(push) == 2:
        told = ", ".join(f"{a} {v:+.3f}" for a, v in zip("xyz", (*push, -force[0]), strict=True))
        return Line(Light.WATCH, "Load", f"pushed by {told} N: something is touched?")
    if force[0] < -half[0]:
        return Line(
            Light.WATCH, "Load", f"pushed up by {-force[0]:.3f} ± {half[0]:.3f} N: something is touched?"
        )
    grams, bar = (1e3 * v / GRAVITY for v in (force[0], half[0]))
    return Line(Light.GOOD, "Load", f"{grams:.1f} ± {bar:.1f} g")


def _expected_line(shift: str, half: str) -> Line:
    """Return the line about the expected error of the pose at rest: three numbers [m] each, or why there are none."""
    places, bars = _numbers(shift), _numbers(half)
    if len(places) != 3 or len(bars) != 3:
        return Line(Light.OFF, "Expected error", shift)
    told = ", ".join(
        f"{a} {1e3 * v:+.2f} ± {1e3 * b:.2f}" for a, v, b in zip("xyz", places, bars, strict=True)
    )
    return Line(Light.GOOD, "Expected error", f"{told} mm (90 %)")


def _numbers(text: str) -> list[float]:
    """Return the finite numbers of a text; none where it is something else."""
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        return []
    return found if np.isfinite(found).all() else []


def ik_silence(age: float | None, mode: Mode) -> Line | None:
    """Return the line for inverse kinematics without a fresh status: it comes once per solve, in mode IK."""
    if age is not None and age <= SILENT:
        return None
    if mode is not Mode.IK:
        return Line(Light.OFF, "Inverse kinematics", "off: the mode is not IK")
    return Line(
        Light.BAD, "Inverse kinematics", "does not answer" if age is None else f"silent for {age:.0f} s"
    )


def robot_line(status: RobotFields) -> Line:
    """Return the line for a fresh status of the driver."""
    if status.port in SIMULATED and status.state in (2, 3, 4, 5):
        return Line(Light.OFF, "Simulated", "no robot connected: the driver talks to a simulated board")
    packets = f"{status.port}, {status.packets_sent} packets"
    texts = {
        0: (Light.OFF, "not connected"),
        1: (Light.WATCH, "connecting"),
        2: (Light.WATCH, f"connected, not allowed to move ({packets})"),
        3: (Light.GOOD, f"follows commands ({packets})"),
        4: (Light.WATCH, f"holds its angles ({packets})"),
        5: (Light.GOOD, f"parked ({packets})"),
        6: (Light.BAD, "fault"),
    }
    line = Line(*_stated("Robot", status.state, texts))
    return replace(line, text=f"{line.text}: {status.message}") if status.message else line


def mode_line(authority: OperatorAuthority) -> Line:
    """Return the line that says who commands the robot, seen by the operator of this page."""
    mode, tracker = authority.mode, authority.tracker
    own = tracker.source == authority.source
    if tracker.lost:
        return Line(
            Light.BAD,
            "STOP",
            f"{name_of(tracker.lost)} is silent: the robot holds, then goes to its park pose",
        )
    if not tracker.source:
        return Line(Light.OFF, "Ready", "nobody commands yet")
    by = "the page" if own else name_of(tracker.source)
    texts = {
        Mode.STOP: (Light.BAD, "all commands off: the robot holds, then moves to its park pose"),
        Mode.TELEOP: (Light.GOOD, "the sliders command" if own else "the keyboard commands"),
        Mode.IK: (Light.GOOD, "the effector follows the green target"),
        Mode.REPLAY: (Light.GOOD, "a recording is played"),
    }
    light, text = texts[mode]
    return Line(light, f"{mode.name}, by {by}", text)


def target_lines(target: NDArray[np.float64] | None, effector: NDArray[np.float64] | None) -> list[Line]:
    """Return the lines about positions of `target` and `effector` [m], None where not known yet."""
    lines = [
        Line(Light.GOOD, "Target", _millimetres(target)),
        Line(Light.WATCH, "Effector", _millimetres(effector)),
    ]
    if target is not None and effector is not None:
        lines.append(Line(Light.OFF, "Distance", f"{1e3 * np.linalg.norm(target - effector):.2f} mm"))
    return lines


def page_line(browsers: int, pictures: float, skipped: tuple[int, str], refused: tuple[int, str]) -> Line:
    """Return the line about this page.

    Args:
        browsers: How many show the page.
        pictures: Body states drawn per second.
        skipped: Number of body states that did not fit the mesh, since start, and the newest reason.
        refused: Number of other messages refused, since start, and the newest with its topic.
    """
    text = f"{pictures:.0f} pictures/s, {browsers} browser" + ("s" if browsers != 1 else "")
    if skipped[0]:
        text += f"; {skipped[0]} body states skipped ({skipped[1]})"
    if refused[0]:
        text += f"; {refused[0]} messages refused ({refused[1]})"
    return Line(Light.WATCH if skipped[0] or refused[0] else Light.GOOD, "This page", text)


def robot_silence(age: float | None) -> Line | None:
    """Return the line for no robot, or one not heard for `age` [s]; None if its status is fresh."""
    if age is None:
        return Line(Light.OFF, "Simulated", "no robot connected")
    return silence("Robot", age)


def _millimetres(position: NDArray[np.float64] | None) -> str:
    if position is None:
        return "not known yet"
    x, y, z = np.round(1e3 * position, 1) + 0.0  # no -0.0
    return f"x {x:.1f}, y {y:.1f}, z {z:.1f} mm"


def _stated(who: str, state: int, texts: Mapping[int, tuple[Light, str]]) -> tuple[Light, str, str]:
    light, text = texts.get(state, (Light.BAD, f"unknown state {state}"))
    return light, who, text
