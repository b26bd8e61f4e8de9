"""The node on a pseudo-terminal: keys in, commands out, and the terminal as it was, however it ends."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.decisions import keep
from tests.messages import assert_names, names
from tripod_graph.command import CommandLimits
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
from tripod_teleop import node as teleop  # noqa: E402
from tripod_teleop.drive import PEAK  # noqa: E402

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
        self.commands: list[JointTrajectory] = []
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
        self.commands.append(message)
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

    def lines(self) -> list[str]:
        """Return all that was on the screen, without what moves its cursor."""
        return re.split(r"[\r\n]|\x1b\[\??\d*\w", self.screen.decode(errors="replace"))

    def shown(self, *what: object) -> int:
        """Wait for a line that names each of `what`; return the time of the system's clock [ns] after that."""
        self.until(lambda: any(names(line, *what) for line in self.lines()), f"{what} on the screen")
        return time.time_ns()

    def last(self) -> np.ndarray:
        return np.array(self.commands[-1].points[-1].positions)

    def positions(self) -> np.ndarray:
        return np.array([m.points[-1].positions for m in self.commands])

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
    session.shown("press t")
    assert session.commands == []
    assert session.modes == []

    session.type(b"t")
    session.until(lambda: session.decided(Mode.TELEOP), "TELEOP")
    assert name_of(session.modes[-1].source) == "teleop"
    session.until(lambda: len(session.commands) >= 10, "set-points")
    assert session.commands[0].joint_names == [*SERVOS, SLIDE]
    assert session.positions() == pytest.approx(np.tile(START, (len(session.commands), 1)))  # nothing jumps
    assert {nanoseconds(m.points[0].time_from_start) for m in session.commands} == {50_000_000}

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

    begin = len(session.commands) - 1
    session.type(b"\x01")  # Ctrl+A
    session.until(lambda: np.abs(session.last() - WORKING_POSE).max() < 1e-9, "the working pose")
    path, sent = session.positions()[begin:], 1e-9 * np.array(session.sent[begin - 1 :])
    fastest = (
        PEAK * np.abs(path[-1] - path[0]) / 1.0
    )  # in 1 s; each set-point was made after the one before had left
    times = sent[2:] - sent[:-2]
    assert (np.abs(np.diff(path, axis=0)) <= fastest * times[:, None] + 1e-9).all()  # streamed, no jump
    session.joints = WORKING_POSE
    where = ("-85.7 deg", "slide", "35.0 mm")
    session.until(
        lambda: any(names(line, *where) and line.count("-85.7") == 3 for line in session.lines()),
        "the angles",
    )

    for keys, angle in ((b"Q", -np.pi / 3), (b"z", -np.pi / 4)):
        session.type(keys)
        expected = [angle] * 3 + [WORKING_POSE[3]]
        session.until(lambda e=expected: np.abs(session.last() - e).max() < 1e-9, f"the pose of {keys!r}")

    session.type(b"\t")  # Ctrl+I
    session.until(lambda: session.decided(Mode.IK), "IK")
    heard_at = time.time_ns()
    session.type(b" ")
    session.until(lambda: session.decided(Mode.STOP), "STOP")
    session.type(b"X")
    session.shown("X", "nothing", "?", "keys")
    assert max(session.sent) < heard_at
    session.type(b"t")
    session.until(lambda: session.decided(Mode.TELEOP), "TELEOP again")
    session.type(b"q")
    assert session.end() == (0, "")
    session.until(lambda: session.decided(Mode.STOP), "the last STOP")
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in session.modes]
    assert stamps == sorted(stamps)
    assert session.attributes() == session.before
    assert session.screen.count(b"\x1b[?2004h") == session.screen.count(b"\x1b[?2004l") == 1


class Desk:
    """A teleop node in this process; its terminal and its clock are in the hands of the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        monkeypatch.setattr(teleop, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(teleop, "clocks", lambda _: (1000.0 + self.now, self.now))
        self.commands: list[JointTrajectory] = []
        self.typed = b""
        self.resets: list[float] = []
        self.node = teleop.TeleopNode(self)
        self.node._command = SimpleNamespace(publish=self.commands.append)
        self.period = 1e-9 * self.node._sending.timer_period_ns
        self.node._sending = SimpleNamespace(reset=self._reset)
        self._due = self.now
        self.type(b"t")
        self.run(1.0)

    def _reset(self) -> None:
        self.resets.append(self.now)
        self._due = self.now + self.period

    def run(self, duration: float) -> None:
        """Let time pass [s], with the regular set-points in it."""
        end = self.now + duration
        while self._due < end - 1e-9:
            self.now = self._due
            self._due += self.period
            self._tell_joints()
            self.node._send()
        self.now = end

    def type(self, keys: bytes) -> None:
        """Type keys; the node is woken, as by its thread at the terminal."""
        self.typed += keys
        self._tell_joints()
        self.node._on_keys()

    def _tell_joints(self) -> None:
        self.node._watch.hear_sim((*SERVOS, SLIDE), START, self.now)

    # what the node asks of a terminal

    def read(self) -> bytes:
        typed, self.typed = self.typed, b""
        return typed

    def wait(self, timeout: float) -> bool:
        return threading.Event().wait(timeout)

    def enter(self) -> None:
        pass

    def restore(self) -> None:
        pass

    def print(self, text: str) -> None:
        pass


@pytest.fixture
def desk(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    rclpy.init(args=[], domain_id=domain)
    made = Desk(monkeypatch)
    yield made
    made.node.close()
    made.node.destroy_node()
    rclpy.shutdown()


def test_a_press_is_answered_at_once_and_the_next_set_point_comes_when_that_is_reached(desk: Desk) -> None:
    assert desk.period == pytest.approx(0.05)
    for k in range(12):  # at many phases of the regular set-points
        desk.run(0.5 + 0.0041 * k)
        rest, count = np.array(desk.commands[-1].points[0].positions), len(desk.commands)
        desk.type(b"\x1b[A" if k % 2 else b"\x1b[B")
        desk.run(0.11)
        answer, *later = desk.commands[count:]
        assert desk.resets[k] == pytest.approx(
            desk.now - 0.11
        )  # the next comes a whole period after the answer
        assert nanoseconds(answer.points[0].time_from_start) == 50_000_000
        moved = [np.abs(np.array(m.points[0].positions) - rest).max() for m in (answer, *later)]
        assert moved == pytest.approx([0.5 * 0.05 * n for n in (1, 2, 3)])  # where a period's motion leads


def test_the_repeats_of_a_key_that_is_down_are_not_answered_one_by_one(desk: Desk) -> None:
    count = len(desk.commands)
    for _ in range(30):
        desk.type(b"\x1b[A")
        desk.run(0.033)
    assert len(desk.resets) == 1
    assert len(desk.commands) - count == 1 + int(30 * 0.033 / desk.period)


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
    session.shown("joint angles", "simulator", "driver")
    count = len(session.commands)
    session.joints = (-0.3, -0.4, -0.7, 0.02)  # the simulator was restarted elsewhere
    session.until(lambda: len(session.commands) > count + 5, "set-points again")
    assert session.last() == pytest.approx(session.joints)

    message = tripod_msgs.ControlMode(mode=int(Mode.TELEOP), source="view", lease=600.0)
    message.header.stamp = session.node.get_clock().now().to_msg()
    session.mode.publish(message)
    shown_at = session.shown("TELEOP", "view")
    session.type(b"\x1b[A\x1b[A")
    session.shown("press t")
    assert max(session.sent) < shown_at
    assert [name_of(m.source) for m in session.modes if m.mode == Mode.TELEOP] == ["teleop", "view"]


def test_it_says_why_the_robot_does_not_obey_its_keys(session: Session) -> None:
    status = tripod_msgs.RobotStatus(
        state=tripod_msgs.RobotStatus.HOLDING,
        message="switched off",
        joint_names=list(SERVOS),
        lower=[-2.1] * 3,
        upper=[0.6] * 3,
        speed=[4.0] * 3,
    )
    statuses = session.node.create_publisher(tripod_msgs.RobotStatus, "robot/status", RELIABLE)
    timer = session.node.create_timer(0.1, lambda: statuses.publish(status))
    session.ready()
    session.shown("driver's range")
    assert not names(session.screen, status.message)
    session.type(b"t")
    session.shown("TELEOP", "these keys", "robot", status.message, "-17.2")
    status.state = tripod_msgs.RobotStatus.ACTIVE
    count = len(session.lines())

    def obeys(line: str) -> bool:
        return names(line, "TELEOP", "these keys", "-17.2") and not names(line, status.message)

    session.until(lambda: any(map(obeys, session.lines()[count:])), "a line without the reason")
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
    ("parameter", "named"),
    [
        ("hold:=7.0", ("'hold'", 7.0, "0.05 to 1 s")),
        ("throw:=[0.9]", ("'throw'", "servo_0", "0.9 rad", "-2.1 to 0.6 rad")),
        ("catch:=[0.1, 0.2, 0.9]", ("'catch'", "servo_2", "0.9 rad", "-2.1 to 0.6 rad")),
    ],
)
def test_a_bad_parameter_is_refused_before_the_terminal_is_touched(
    domain: int, parameter: str, named: tuple[object, ...]
) -> None:
    session = Session(domain, parameter)
    try:
        code, errors = session.end()
        assert (code, errors.count("\n")) == (2, 1)
        assert_names(errors, "teleop:", *named)
        assert session.attributes() == session.before
        assert session.screen == b""
    finally:
        session.close()


def test_a_park_position_of_all_joints_goes_with_one_angle_for_all_servos() -> None:
    limits = CommandLimits(park=(-1.4965, -1.4965, -1.4965, 0.035))
    assert teleop.checked_angles("catch", [0.3], limits) == (0.3,)


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
    assert run.stderr.count("\n") == 1
    assert_names(run.stderr, "teleop", "terminal", "standard input")
