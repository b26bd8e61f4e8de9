"""The node on a pseudo-terminal: keys in, commands out, and the terminal as it was, however it ends."""

import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.decisions import keep
from tripod_graph.mode import Mode
from tripod_graph.names import SERVOS, SLIDE, WORKING_POSE
from tripod_graph.source import name_of

rclpy = pytest.importorskip("rclpy")
tripod_msgs = pytest.importorskip("tripod_msgs.msg")
pytestmark = pytest.mark.ros

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

from tripod_graph.qos import LATCHED, LATCHED_OF_ALL, RELIABLE  # noqa: E402

ROOT = Path(__file__).parents[2]
DEADLINE = 60.0  # [s], discovery alone may take three
PROGRAM = """
import fcntl, sys, termios
from tripod_teleop.node import main

fcntl.ioctl(0, termios.TIOCSCTTY, 0)  # as in a shell: its Ctrl-C is a signal, its loss a hang-up
sys.exit(main(sys.argv[1:]))
"""
START = (-0.3, -0.4, -0.5, 0.01)


class Session:
    """A teleop node on a pseudo-terminal, and a node that stands for the rest of the graph."""

    def __init__(self, domain: int, *arguments: str) -> None:
        self.master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
        self.before = termios.tcgetattr(self.slave)
        self.screen = b""
        self.process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *arguments],
            cwd=ROOT,
            stdin=self.slave,
            stdout=self.slave,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = Node("robot", context=self.context)
        self.executor.add_node(self.node)
        self.commands: list[tuple[float, JointTrajectory]] = []
        self.sent: list[int] = []  # when each left, by the system's clock [ns]
        self.modes: list[Any] = []
        self.joints: tuple[float, ...] | None = START
        self.states = self.node.create_publisher(JointState, "sim/joint_states", RELIABLE)
        self.mode = self.node.create_publisher(tripod_msgs.ControlMode, "control_mode", LATCHED)
        self.node.create_subscription(
            JointTrajectory,
            "joint_trajectory",
            self._keep,
            RELIABLE,
        )
        self.node.create_subscription(
            tripod_msgs.ControlMode, "control_mode", lambda m: keep(self.modes, m), LATCHED_OF_ALL
        )
        self.node.create_timer(0.02, self._tell_joints)

    def _keep(self, message: JointTrajectory, info: dict[str, int]) -> None:
        self.commands.append((time.monotonic(), message))
        self.sent.append(info["source_timestamp"])

    def _tell_joints(self) -> None:
        if self.joints is not None:
            self.states.publish(JointState(name=[*SERVOS, SLIDE], position=list(self.joints)))

    def until(self, done: Callable[[], Any], what: str) -> Any:
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            if result := done():
                return result
            self.executor.spin_once(timeout_sec=0.01)
            self._read_screen()
        raise AssertionError(f"{what} did not happen; the screen: {self.screen.decode()[-500:]!r}")

    def _read_screen(self) -> None:
        while self.master >= 0 and select.select([self.master], [], [], 0)[0]:
            try:
                data = os.read(self.master, 4096)
            except OSError:
                return
            self.screen += data

    def ready(self) -> None:
        """Wait until it shows the angles: then it hears the graph, and takes keys."""
        self.until(lambda: b"-17.2" in self.screen, "the status line")

    def type(self, keys: bytes) -> None:
        os.write(self.master, keys)

    def shown(self, text: str) -> None:
        self.until(lambda: text.encode() in self.screen, f"{text!r} on the screen")

    def last(self) -> np.ndarray:
        return np.array(self.commands[-1][1].points[-1].positions)

    def positions(self) -> np.ndarray:
        return np.array([m.points[-1].positions for _, m in self.commands])

    def effect(self, keys: bytes) -> np.ndarray:
        """Press a key once; return by how much the set-point has moved when it rests again."""
        count, before = len(self.commands), self.last()
        self.type(keys)

        def rests() -> bool:
            path = self.positions()[count:]
            return len(path) > 2 and np.ptp(path[-3:], axis=0).max() == 0 != np.abs(path[-1] - before).max()

        self.until(rests, f"the effect of {keys!r}")
        return self.last() - before

    def decided(self, mode: Mode) -> bool:
        return bool(self.modes) and self.modes[-1].mode == mode

    def end(self) -> tuple[int, str]:
        """Wait for its end; return exit code and errors."""
        self.until(lambda: self.process.poll() is not None, "the end")
        assert self.process.stderr is not None
        return self.process.returncode, self.process.stderr.read().decode()

    def attributes(self) -> list[Any]:
        return termios.tcgetattr(self.slave)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self.process.kill()  # after the graph was left: see tests/domains.py
        self.process.communicate()
        for fd in (self.master, self.slave):
            if fd >= 0:
                os.close(fd)


@pytest.fixture
def session(domain: int) -> Iterator[Session]:
    made = Session(domain, "pose_time:=1.0")
    yield made
    made.close()


def test_keys_drive_and_q_leaves(session: Session) -> None:
    session.ready()
    assert session.attributes()[3] & (termios.ICANON | termios.ECHO) == 0
    session.type(b"\x1b[A")
    session.shown("press t to drive by these keys")
    assert session.commands == []
    assert session.modes == []

    session.type(b"t")
    session.until(lambda: session.decided(Mode.TELEOP), "TELEOP")
    assert name_of(session.modes[-1].source) == "teleop"
    session.until(lambda: len(session.commands) >= 10, "set-points")
    assert session.commands[0][1].joint_names == [*SERVOS, SLIDE]
    assert session.positions() == pytest.approx(np.tile(START, (len(session.commands), 1)))  # nothing jumps
    times = np.array([t for t, _ in session.commands])
    assert np.median(np.diff(times)) == pytest.approx(0.05, abs=0.02)

    for keys, servo, sign in (
        (b"\x1b[A", 0, 1),
        (b"\x1b[1;5B", 0, -1),
        (b"\x1bOD", 1, 1),
        (b"\x1b[1;5C", 1, -1),
        (b"+", 2, 1),
        (b"-", 2, -1),
    ):
        # a node that the machine holds up for long moves less, never more: then once more
        for _ in range(10):
            moved = sign * session.effect(keys)
            assert np.abs(np.delete(moved, servo)).max() < 1e-6
            assert 0 < moved[servo] < 0.5 * 0.2 + 1e-6
            if moved[servo] > 0.5 * 0.2 - 1e-6:
                break
        else:
            pytest.fail(f"the effect of {keys!r} is {moved}")

    session.type(b"\x01")  # Ctrl+A
    session.until(lambda: np.abs(session.last() - WORKING_POSE).max() < 1e-9, "the working pose")
    path = session.positions()
    assert np.abs(np.diff(path[:, :3], axis=0)).max() < 0.3  # streamed, no jump
    session.joints = WORKING_POSE
    session.shown("-85.7  -85.7  -85.7 deg, slide 35.0 mm")

    for keys, angle in ((b"Q", -np.pi / 3), (b"z", -np.pi / 4)):
        session.type(keys)
        expected = [angle] * 3 + [WORKING_POSE[3]]
        session.until(lambda e=expected: np.abs(session.last() - e).max() < 1e-9, f"the pose of {keys!r}")

    session.type(b"\t")  # Ctrl+I
    session.until(lambda: session.decided(Mode.IK), "IK")
    count = len(session.commands)
    session.type(b" ")
    session.until(lambda: session.decided(Mode.STOP), "STOP")
    session.type(b"X")
    session.shown("X does nothing here; ? shows the keys")
    assert len(session.commands) <= count + 1
    session.type(b"t")
    session.until(lambda: session.decided(Mode.TELEOP), "TELEOP again")
    session.type(b"q")
    assert session.end() == (0, "")
    session.until(lambda: session.decided(Mode.STOP), "the last STOP")
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in session.modes]
    assert stamps == sorted(stamps)
    assert session.attributes() == session.before
    assert session.screen.count(b"\x1b[?2004h") == session.screen.count(b"\x1b[?2004l") == 1


def test_a_press_is_answered_at_once_and_the_next_set_point_comes_when_that_is_reached(
    session: Session,
) -> None:
    session.ready()
    session.type(b"t")
    session.until(lambda: len(session.commands) >= 3, "set-points")
    found = []
    for k in range(12):  # at many phases of the regular set-points
        end = time.monotonic() + 0.3 + 0.0041 * k
        session.until(lambda e=end: time.monotonic() > e, "rest")
        rest, count = session.last(), len(session.commands)
        session.type(b"\x1b[A" if k % 2 else b"\x1b[B")
        session.until(lambda n=count: len(session.commands) >= n + 4, "set-points")
        found.append((rest, [m for _, m in session.commands[count - 1 :]], session.sent[count - 1 :]))
    gaps = []
    for rest, commands, sent in found:
        moved = [np.abs(np.array(m.points[0].positions) - rest).max() for m in commands]
        answer = next(i for i, way in enumerate(moved) if way > 1e-9)
        assert 0.5 * 0.05 - 1e-6 <= moved[answer] < 0.5 * 0.1  # where a period's motion leads
        assert nanoseconds(commands[answer].points[0].time_from_start) == 50_000_000
        assert moved[answer + 1] > moved[answer]
        stamps = sent[answer - 1 : answer + 2]
        assert stamps[2] - stamps[1] > 45e6
        gaps.append(stamps[1] - stamps[0])
    assert min(gaps) < 40e6  # it did not wait for the turn of a regular one


def test_the_repeats_of_a_key_that_is_down_are_not_answered_one_by_one(session: Session) -> None:
    session.ready()
    session.type(b"t")
    session.until(lambda: len(session.commands) >= 3, "set-points")
    count, presses = len(session.commands), []
    for _ in range(30):
        session.type(b"\x1b[A")
        presses.append(time.monotonic())
        session.until(lambda e=presses[-1] + 0.033: time.monotonic() > e, "the next repeat")
    stamps = session.sent[count:]
    answers = 1 + int(
        (np.diff(presses) > 0.1).sum()
    )  # on a busy machine a press may end before its repeat comes
    assert len(stamps) <= (stamps[-1] - stamps[0]) / 50e6 + 2 + answers


def nanoseconds(time_or_duration: Any) -> int:
    return int(10**9 * time_or_duration.sec + time_or_duration.nanosec)


@pytest.mark.parametrize("how", ["SIGTERM", "SIGHUP", "SIGINT", "Ctrl-C", "hang-up"])
def test_it_stops_the_robot_and_restores_the_terminal(session: Session, how: str) -> None:
    session.ready()
    session.type(b"t")
    session.until(lambda: session.commands, "set-points")
    if how == "Ctrl-C":
        session.type(b"\x03")
    elif how == "hang-up":
        os.close(session.master)
        session.master = -1
    else:
        session.process.send_signal(signal.Signals[how])
    code, errors = session.end()
    assert code == 0
    assert errors == "" or how == "hang-up"
    assert "Traceback" not in errors
    session.until(lambda: session.decided(Mode.STOP), "the last STOP")
    if how != "hang-up":
        assert session.attributes() == session.before


def test_it_falls_silent_when_another_decides_or_the_joints_are_lost(session: Session) -> None:
    session.ready()
    session.type(b"t")
    session.until(lambda: len(session.commands) > 5, "set-points")
    assert session.positions() == pytest.approx(np.tile(START, (len(session.commands), 1)))

    session.joints = None
    session.shown("the joint angles are not known")
    count = len(session.commands)
    session.joints = (-0.3, -0.4, -0.7, 0.02)  # the simulator was restarted elsewhere
    session.until(lambda: len(session.commands) > count + 5, "set-points again")
    assert session.last() == pytest.approx(session.joints)

    message = tripod_msgs.ControlMode(mode=int(Mode.TELEOP), source="view", lease=600.0)
    message.header.stamp = session.node.get_clock().now().to_msg()
    session.mode.publish(message)
    session.shown("TELEOP by view")
    count = len(session.commands)
    session.type(b"\x1b[A\x1b[A")
    session.shown("press t to drive by these keys")
    assert len(session.commands) <= count + 1
    assert [name_of(m.source) for m in session.modes if m.mode == Mode.TELEOP] == ["teleop", "view"]


def test_it_says_why_the_robot_does_not_obey_its_keys(session: Session) -> None:
    status = tripod_msgs.RobotStatus(
        state=tripod_msgs.RobotStatus.HOLDING,
        message="stopped by service",
        joint_names=list(SERVOS),
        lower=[-2.1] * 3,
        upper=[0.6] * 3,
        speed=[4.0] * 3,
    )
    statuses = session.node.create_publisher(tripod_msgs.RobotStatus, "robot/status", RELIABLE)
    timer = session.node.create_timer(0.1, lambda: statuses.publish(status))
    session.ready()
    session.shown("(the driver's range)")
    assert b"stopped by service" not in session.screen
    session.type(b"t")
    session.shown("TELEOP by these keys | robot: stopped by service |  -17.2")
    status.state = tripod_msgs.RobotStatus.ACTIVE
    session.shown("TELEOP by these keys |  -17.2")
    timer.cancel()


def test_bad_messages_are_counted_and_change_nothing(session: Session) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    health: list[Any] = []
    session.node.create_subscription(DiagnosticArray, "/diagnostics", health.append, RELIABLE)
    session.ready()
    session.joints = None
    session.states.publish(JointState(name=list(SERVOS), position=[float("nan"), 0.0, 0.0]))
    session.states.publish(JointState(name=["elbow"], position=[0.0, 1.0]))
    session.mode.publish(tripod_msgs.ControlMode(mode=77))
    session.joints = START

    def values() -> dict[str, str]:
        found = [s for m in health for s in m.status if s.name == "/teleop"]
        return {v.key: v.value for v in found[-1].values} if found else {}

    session.until(lambda: values().get("rejected messages") == "3", "three rejections")
    assert values()["last rejection"].startswith(("control_mode: ", "sim/joint_states: "))
    assert values()["control mode"] == "STOP"
    assert session.process.poll() is None


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("hold:=7.0", "parameter 'hold' is 7.0; allowed: 0.05 to 1 s"),
        ("throw:=[0.9]", "parameter 'throw': servo_0 is 0.9 rad, allowed is -2.1 to 0.6 rad"),
        ("catch:=[0.1, 0.2, 0.9]", "parameter 'catch': servo_2 is 0.9 rad, allowed is -2.1 to 0.6 rad"),
    ],
)
def test_a_bad_parameter_is_refused_before_the_terminal_is_touched(
    domain: int, parameter: str, message: str
) -> None:
    session = Session(domain, parameter)
    try:
        code, errors = session.end()
        assert (code, errors) == (2, f"teleop: {message}\n")
        assert session.attributes() == session.before
        assert session.screen == b""
    finally:
        session.close()


def test_without_a_terminal_it_says_so() -> None:
    run = subprocess.run(
        [sys.executable, "-m", "tripod_teleop.node"],
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("teleop needs a terminal: standard input is none; run it by itself")
    assert run.stderr.count("\n") == 1
