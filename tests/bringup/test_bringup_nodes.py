"""The two nodes inside `tripod up`: what the watch makes of statuses, what the demo measures and when."""

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("tripod_msgs", reason="the messages are not built: run `make setup`")

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from tripod_msgs.msg import ControlMode, IkStatus, RobotStatus, SimStatus

from tests.messages import assert_names
from tests.messages import names as names_all
from tripod_bringup import watch as watch_module
from tripod_bringup.demo import DemoNode, seconds, trajectory_message
from tripod_bringup.demo_session import Phase
from tripod_bringup.demo_target import DemoTarget
from tripod_bringup.watch import ROBOT_STATES, SIM_STATES, Watch
from tripod_graph import names
from tripod_graph.diagnostic_keys import CONNECTION_ERROR
from tripod_graph.diagnostics import Diagnostics, Level
from tripod_graph.mode import Mode
from tripod_graph.names import WORKING_POSE
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_graph.source import name_of

pytestmark = pytest.mark.ros

DEADLINE = 60.0
"""For a loaded machine [s]; nothing here waits so long unless it fails."""


@pytest.fixture
def spin(domain: int) -> Iterator[Callable[..., None]]:
    """Start ROS on a domain of its own; the function spins nodes until a condition holds."""
    rclpy.init(args=[], domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()

    def until(condition: Callable[[], bool], *nodes: Node) -> None:
        for node in nodes:
            executor.add_node(node)
        end = time.monotonic() + DEADLINE
        while not condition():
            assert time.monotonic() < end, f"it did not happen within {DEADLINE} s"
            executor.spin_once(timeout_sec=0.01)

    yield until
    executor.shutdown()
    rclpy.shutdown()


def test_the_watch_tells_what_it_heard_and_forgets_what_fell_silent(
    spin: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch_module, "SILENT_AFTER", math.inf)
    watch, other = Watch(), Node("other")
    sim = other.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
    ik = other.create_publisher(IkStatus, names.IK_STATUS, RELIABLE)
    robot = other.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    assert watch.status().mode == "STOP"
    assert not watch.heard(names.SIM_STATUS) and watch.status().sim_state is None

    def everything() -> bool:
        sim.publish(SimStatus(state=SimStatus.RUNNING, real_time_factor=0.5, step_time_median=0.002))
        ik.publish(IkStatus(state=IkStatus.CLOSEST, error=0.001))
        robot.publish(RobotStatus(state=RobotStatus.DISCONNECTED, packets_sent=7, message="no port"))
        return all(map(watch.heard, (names.SIM_STATUS, names.IK_STATUS, names.ROBOT_STATUS)))

    spin(everything, watch, other)
    status = watch.status()
    assert (status.sim_state, status.real_time_factor, status.step_time) == ("RUNNING", 0.5, 0.002)
    assert (status.ik_state, status.ik_error) == ("CLOSEST", 0.001)
    assert (status.robot_state, status.packets) == ("DISCONNECTED", 7)
    assert status.note == "driver: no port"
    for state, note in ((SimStatus.RUNNING, "driver: no port"), (SimStatus.FAILED, "sim: of the simulator")):

        def simulator(state: int = state) -> bool:
            sim.publish(SimStatus(state=state, message="of the simulator"))
            return watch.status().sim_state == SIM_STATES[state]

        spin(simulator, watch, other)
        spin(lambda note=note: watch.status().note == note, watch, other)
    assert watch.is_published(names.IK_STATUS) and not watch.is_published(names.COMPLIANCE)

    monkeypatch.setattr(watch_module, "SILENT_AFTER", -1.0)
    silent = watch.status()
    assert (silent.sim_state, silent.packets) == (None, None)
    assert_names(silent.note, "sim", "silent")


def test_the_watch_tells_why_no_board_has_ever_answered(spin: Callable[..., None]) -> None:
    watch, driver = Watch(), Node("driver")
    robot = driver.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)

    def tell(state: int, message: str = "") -> None:
        """Publish a status until the watch shows it."""

        def shown() -> bool:
            robot.publish(RobotStatus(state=state, message=message))
            return watch.status().robot_state == ROBOT_STATES[state]

        spin(shown, watch, driver)

    why = [""]
    health = Diagnostics(driver, lambda: (Level.ERROR, "DISCONNECTED", {CONNECTION_ERROR: why[0]}))
    tell(RobotStatus.CONNECTING, "waiting up to 2 s for the board's answer")
    assert watch.absence == "", "nobody has waited long enough"
    why[0] = "/dev/nope does not exist"
    spin(lambda: watch.absence == "/dev/nope does not exist", watch, driver)
    why[0] = ""
    tell(RobotStatus.CONNECTING)
    assert watch.absence == "/dev/nope does not exist"
    tell(RobotStatus.READY)
    assert watch.absence == ""
    why[0] = "it was lost"
    tell(RobotStatus.DISCONNECTED, "it was lost")
    assert watch.absence == "", "it did answer"
    assert health


def test_the_watch_tells_what_the_recorder_complains_of(spin: Callable[..., None]) -> None:
    watch, other, record = Watch(), Node("other"), Node("record")
    other_health = Diagnostics(other, lambda: (Level.ERROR, "of no matter here", {}))
    said: list[tuple[Level, str]] = [(Level.OK, "recording")]
    health = Diagnostics(record, lambda: (*said[-1], {}))

    def told(note: str) -> Callable[[], bool]:
        def check() -> bool:
            other_health.publish()
            health.publish()
            return watch.heard("/record") and watch.status().note == note

        return check

    spin(told(""), watch, other, record)
    said.append((Level.ERROR, "the disk is full"))
    spin(told("record: the disk is full"))
    said.append((Level.WARN, "it goes on elsewhere"))
    spin(told("record: it goes on elsewhere"))
    robot = other.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    other.create_subscription(RobotStatus, names.ROBOT_STATUS, print, RELIABLE)
    spin(lambda: watch.count_subscribers(names.ROBOT_STATUS) == 2)
    assert not watch.is_recorded(names.ROBOT_STATUS)
    record.create_subscription(RobotStatus, names.ROBOT_STATUS, print, RELIABLE)
    spin(lambda: watch.is_recorded(names.ROBOT_STATUS))

    def complain(note: str) -> Callable[[], bool]:
        def check() -> bool:
            robot.publish(RobotStatus(state=RobotStatus.DISCONNECTED, message="no port"))
            return told(note)()

        return check

    spin(complain("driver: no port"))
    said.append((Level.ERROR, "the disk is full"))
    spin(complain("record: the disk is full"))
    said.append((Level.OK, "recording"))
    spin(complain("driver: no port"))


def test_the_watch_tells_that_a_node_runs_twice_while_it_does(spin: Callable[..., None]) -> None:
    watch, other, second = Watch(), Node("other"), Node("second")
    publishers = [node.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE) for node in (other, second)]

    def tells(matches: Callable[[str], bool]) -> Callable[[], bool]:
        def check() -> bool:
            publishers.append(publishers.pop(0))  # in turns
            publishers[0].publish(SimStatus(state=SimStatus.RUNNING))
            return watch.heard(names.SIM_STATUS) and matches(watch.status().note)

        return check

    spin(tells(lambda note: names_all(note, "sim", "more than once")), watch, other, second)
    publishers.pop()  # it falls silent, and is still known
    spin(tells(lambda note: note == ""))
    assert watch.count_publishers(names.SIM_STATUS) == 2


def test_the_word_stop_reaches_who_listens_and_who_comes_later(spin: Callable[..., None]) -> None:
    watch, other = Watch(), Node("other")
    heard: list[Any] = []
    other.create_subscription(ControlMode, names.CONTROL_MODE, heard.append, LATCHED)
    watch.say_stop()
    late: list[Any] = []
    other.create_subscription(ControlMode, names.CONTROL_MODE, late.append, LATCHED)
    spin(lambda: bool(heard and late), watch, other)
    assert (heard[0].mode, name_of(heard[0].source)) == (Mode.STOP, "up")
    assert seconds(heard[0].header.stamp) > 0, "the newest decision wins by its stamp"


def pose(stamp: float, x: float) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp.sec = int(stamp)
    message.header.stamp.nanosec = round((stamp - int(stamp)) * 1e9)
    message.pose.position.x = x
    return message


def test_the_demo_measures_while_it_tracks_after_the_first_second_and_not_once_cut_off(
    spin: Callable[..., None],
) -> None:
    demo = DemoNode(track=None)
    demo._on_effector(pose(100.0, 0.0))
    assert demo.measured.tracking.count == 0, "nothing is measured before the circle"
    demo.session.phase, demo.session.target = Phase.TRACK, DemoTarget((0.0, 0.0, 0.0))
    demo._stamp_start = 100.0
    demo._on_effector(pose(100.9, 1.0))
    assert demo.measured.tracking.count == 0, "nor in its first second"
    x, y, z = demo.session.target(1.5)
    off = pose(101.5, float(x) + 0.003)
    off.pose.position.y, off.pose.position.z = float(y), float(z)
    demo._on_effector(off)
    assert demo.measured.tracking.rms == pytest.approx(0.003)
    solved = IkStatus(state=IkStatus.TRACKING, header=off.header)
    demo._on_ik_status(IkStatus(state=IkStatus.TRACKING, header=pose(100.9, 0.0).header))
    assert demo.measured.ik_solved == 0, "nor does an answer in the first second count"
    demo._on_ik_status(solved)
    demo._on_ik_status(IkStatus(state=IkStatus.STALE, header=off.header))
    assert demo.measured.ik_solved == 1, "a stale solution is none"
    assert demo.measured.ik_states == {"TRACKING": 2, "STALE": 1}
    demo.finish()
    demo._on_effector(pose(102.0, 1.0))
    demo._on_ik_status(solved)
    assert (demo.measured.tracking.count, demo.measured.ik_solved) == (1, 1)
    assert demo.measured.session_failure == "", "cut off while tracking: that is how it is meant to end"


def test_a_demo_cut_off_before_it_tracks_says_so(spin: Callable[..., None]) -> None:
    demo = DemoNode(track=None)
    demo.finish()
    assert_names(demo.measured.session_failure, "stopped", "waiting", "chain")


def test_the_way_to_the_working_pose_names_every_joint() -> None:
    message = trajectory_message(WORKING_POSE, 2.5, pose(1.0, 0.0).header.stamp)
    assert message.joint_names == ["servo_0", "servo_1", "servo_2", "slide"]
    (point,) = message.points
    assert tuple(point.positions) == WORKING_POSE
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (2, 500_000_000)
