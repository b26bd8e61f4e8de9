"""The driver as users meet it: a process between the graph and a board, here a pseudo-terminal."""

import itertools
import math
import re
import signal
import time

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from tests import messages
from tests.decisions import SOURCE, said
from tests.driver.operator import EXACT, LONGEST_STEP, Operator, changes, near
from tripod_driver.protocol import AngleMapping, LegacyProtocol
from tripod_driver.settings import PARAMETERS, make_driver
from tripod_graph import names
from tripod_graph.mode import Mode

FLAT = "start:=[0.0,0.0,0.0]"
"""Where the firmware of these tests puts the servos when it starts."""

PARKED = LegacyProtocol().decode(LegacyProtocol().encode([0.0, 0.0, 0.0]))


# what leaves ----------------------------------------------------------------------------------------------


@pytest.mark.ros
@pytest.mark.parametrize("mapping", list(AngleMapping))
def test_packets_decoded_from_the_pseudo_terminal_equal_the_angles_commanded(
    mapping, board, operator, client, start_driver
) -> None:
    board.decoder.protocol = LegacyProtocol(mapping)
    start_driver(
        f"port:={board.path}",
        "protocol:=legacy",
        "boot_time:=0",
        f"angle_mapping:={mapping}",
        "angle_speed:=8",
    )
    operator.ready()
    poses = [
        [-0.1, -0.2, -0.3],
        [-1.4965, -1.4965, -1.4965],
        [-2.0, -0.05, -1.0],
        [-0.5236, -1.0472, -1.5708],
    ]
    for pose in poses:
        client.wait(
            lambda pose=pose: board.packets and near(board.packets[-1], pose),
            f"the packet of {pose}",
            meanwhile=lambda pose=pose: operator.send(pose),
        )
    count = len(board.packets)
    begin, end = np.array(poses[-1]), np.array([-0.8236, -0.6472, -1.3708])
    asked_at = time.monotonic()
    operator.send(list((begin + end) / 2), list(end), times=(1.0, 2.0))
    client.wait(lambda: board.packets and near(board.packets[-1], end), "the end of the path")
    line = np.array(board.packets[count:])
    fractions = (line - begin) / (end - begin)  # of the way; all servos are equally far
    assert (np.ptp(fractions, axis=1) <= 2 * EXACT / np.abs(end - begin).min()).all()
    assert (np.diff(line, axis=0) * np.sign(end - begin) >= -1e-9).all()
    assert board.times[-1] - asked_at > 1.9  # the path takes 2 s; the last half degree is rounded
    assert board.decoder.skipped == 0

    def same() -> bool:
        sent = set(board.packets)  # before the first packet they tell where the firmware put the servos
        said = changes(m.position for m in operator.joint_states if tuple(m.position) in sent)
        return bool(said) and said == changes(board.packets)[-len(said) :]

    client.wait(same, "joint states equal to the packets")
    assert operator.joint_states[-1].name == list(names.SERVOS)
    client.wait(
        lambda: np.allclose(operator.status.commanded, end, rtol=0, atol=1e-9), "the end in the status"
    )
    client.wait(lambda: list(operator.status.sent) == list(board.packets[-1]), "the packet in the status")
    assert operator.status.bytes_sent == 4 * operator.status.packets_sent


@pytest.mark.parametrize("rate", [50.0, 10.0])
def test_at_most_as_many_packets_leave_a_second_as_the_rate_says(rate: float) -> None:
    values = {"port": "mock", "protocol": "legacy", "boot_time": 0.0, "rate": rate}
    driver = make_driver({p.name: p.default for p in PARAMETERS} | values)
    driver.connect()
    driver.safety.activate(0.0)
    driver.tick(0.0)
    driver.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, 0.0)
    sent = []
    for now in 0.001 * np.arange(3000):
        angle = -0.7 + 0.7 * math.cos(4 * now)
        driver.safety.trajectory(names.SERVOS, [0.0], [[angle] * 3], now, source=SOURCE)
        if driver.tick(now):
            sent.append(now)
    assert 0.5 * rate * 3.0 <= len(sent) <= rate * 3.0 + 1


@pytest.mark.ros
def test_unchanged_packets_are_kept_alive(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "keep_alive:=0.1")
    operator.ready()
    moves = itertools.count()
    client.wait(
        lambda: len(set(board.packets)) >= 10,
        "motion",
        meanwhile=lambda: operator.send([-0.7 + 0.7 * math.cos(0.1 * next(moves))] * 3),
    )
    count = operator.wait_hold(board)
    client.wait(lambda: len(board.packets) >= count + 5, "the keep-alive")
    assert len(set(board.packets[count:])) == 1


# what is refused ------------------------------------------------------------------------------------------


@pytest.mark.ros
def test_bad_commands_are_ignored_counted_and_reported(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", FLAT)
    operator.ready()
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.5] * 3),
        "the first pose",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    bad = [
        ([math.nan, 0.0, 0.0], names.SERVOS, ("point 0", "servo_0", "nan rad", "-2.1 to 0.6 rad")),
        ([0.0, 0.0, 0.7], names.SERVOS, ("point 0", "servo_2", "0.7 rad", "-2.1 to 0.6 rad")),
        ([0.0, 0.0, 0.0], ("servo_0", "servo_1", "elbow"), ("'elbow'", "servo_0, servo_1")),
        ([0.0, 0.0], names.SERVOS, ("point 0", "2 positions", "3 joints")),
        ([0.0, 0.0], names.SERVOS[:2], ("'servo_2'", "missing", "servo_0, servo_1, servo_2")),
    ]
    for count, (point, joints, wrong) in enumerate(bad, start=1):
        operator.send(point, joints=joints)
        client.wait(lambda count=count: operator.status.rejected_commands == count, f"rejection {count}")
        messages.assert_names(operator.status.last_rejection, *wrong)
    operator.send([-1.0] * 3, [-1.5] * 3, times=(0.5, 0.2))
    client.wait(lambda: operator.status.rejected_commands == 6, "the falling times")
    messages.assert_names(operator.status.last_rejection, "point 1", "0.2 s", "0.5 to 600 s")
    operator.mode(9)
    client.wait(lambda: operator.status.rejected_commands == 7, "the rejected mode")
    messages.assert_names(operator.status.last_rejection, "control mode 9", "0 STOP, 1 TELEOP")
    operator.send([-0.6, -0.6, -0.6, 0.02], joints=(*names.SERVOS, names.SLIDE))  # the slide is no mistake
    client.wait(lambda: board.packets and near(board.packets[-1], [-0.6] * 3), "the pose after")
    assert operator.status.rejected_commands == 7
    allowed = [p for p in changes(board.packets) if not all(-0.6 - EXACT <= a <= EXACT for a in p)]
    assert allowed == []


# holding and parking --------------------------------------------------------------------------------------


@pytest.mark.ros
def test_silence_holds_then_parks(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "timeout:=0.2", "park_after:=2.0")
    operator.ready()
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.5] * 3),
        "the pose",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    operator.statuses.clear()
    client.wait(lambda: operator.statuses and operator.status.state == operator.status.PARKED, "parking")
    assert operator.status.HOLDING in [status.state for status in operator.statuses]
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")


@pytest.mark.ros
def test_stop_service_and_stop_mode_hold_at_once_until_the_mode_changes(
    board, operator, client, start_driver
) -> None:
    from std_srvs.srv import Trigger

    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "angle_speed:=1", FLAT)
    operator.ready()
    client.wait(
        lambda: (
            board.packets and operator.status.state == operator.status.ACTIVE and board.packets[-1][0] < -0.1
        ),
        "motion",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    answer = client.call(Trigger, names.ROBOT_STOP, Trigger.Request())
    assert answer.success
    held = operator.wait_hold(board)
    operator.send([-2.0, -2.0, -2.0])
    client.wait(lambda: len(board.packets) > held + 3, "the keep-alive")
    assert len(set(board.packets[held:])) == 1
    operator.wait_state(operator.status.HOLDING, "the hold")
    client.wait(lambda: messages.names(operator.status.message, "service", "control mode"), "the reason")
    operator.mode(Mode.REPLAY)
    client.wait(lambda: operator.status.message == "", "the release")
    client.wait(
        lambda: (
            board.packets and operator.status.state == operator.status.ACTIVE and board.packets[-1][0] < -0.5
        ),
        "motion again",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    operator.mode(Mode.STOP)
    client.wait(lambda: operator.status.authority.mode == Mode.STOP, "the stop")
    held = operator.wait_hold(board)
    client.wait(
        lambda: messages.names(operator.status.message, "STOP", "ignored"),
        "the reason",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    client.wait(lambda: len(board.packets) > held + 3, "the keep-alive")
    assert len(set(board.packets[held:])) == 1


@pytest.mark.ros
def test_a_late_driver_obeys_the_newest_decision_of_all_operators_and_any_stop(
    board, operator, client, start_driver
) -> None:
    """A STOP that is still said counts, however old: the operator then decides again."""
    others = [Operator(client) for _ in range(3)]
    operator.mode(Mode.IK, stamp=2000.0, source="/a")  # the newest decision was published first
    for k, (other, stamp) in enumerate(zip(others[:2], (1000.0, 1500.0), strict=True)):
        other.mode(Mode.TELEOP, stamp=stamp, source=f"/b{k}")
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", FLAT)
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.3] * 3),
        "motion in mode IK",
        meanwhile=lambda: operator.send([-0.3] * 3),
    )
    client.wait(lambda: operator.status.authority.source == "/a", "the newest decision")
    assert operator.status.authority.mode == Mode.IK
    others[2].mode(Mode.STOP, stamp=500.0)
    operator.wait_state(operator.status.HOLDING, "the hold")
    others[2].mode(Mode.IK)
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.6] * 3),
        "motion again",
        meanwhile=lambda: operator.send([-0.6] * 3),
    )


# who is in charge ------------------------------------------------------------------------------------------


@pytest.mark.ros
@pytest.mark.parametrize("before", [-7200.0, 0.0, 0.9, 3600.0, 1e8])
@pytest.mark.parametrize("own", [-3600.0, 3600.0])
def test_a_stop_stops_whatever_was_stamped_before(before, own, board, operator, client, start_driver) -> None:
    """Seconds ahead of the clock: of the decision in force, and of the STOP of another operator."""
    now = client.node.get_clock().now().nanoseconds / 1e9
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "angle_speed:=0.5", FLAT)
    operator.ready()
    operator.mode(Mode.STOP)
    operator.mode(Mode.IK, stamp=now + before, source="/skewed")
    operator.mode(Mode.IK)  # where that was too old to count
    client.wait(
        lambda: (
            board.packets and operator.status.state == operator.status.ACTIVE and board.packets[-1][0] < -0.1
        ),
        "motion",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    Operator(client).stop_once_heard(stamp=now + own)
    client.wait(lambda: operator.status.authority.source == "/panic", "the stop")
    held = operator.wait_hold(board)
    client.wait(
        lambda: len(board.packets) > held + 3,
        "the keep-alive",
        meanwhile=lambda: operator.send([-2.0, -2.0, -2.0]),
    )
    assert len(set(board.packets[held:])) == 1


@pytest.mark.ros
def test_a_lost_operator_and_its_long_trajectory_end_together(board, operator, client, start_driver) -> None:
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "park_after:=2.0", FLAT)
    operator.ready(lease=1.5)
    operator.send([-2.0, -2.0, -2.0], times=(200.0,))
    client.wait(lambda: operator.status.authority.lost == SOURCE, "the loss")
    first = next(status for status in operator.statuses if status.authority.lost == SOURCE)
    assert first.state == first.HOLDING
    messages.assert_names(first.message, f"operator {SOURCE!r}", "silent", "park pose")
    operator.wait_state(operator.status.PARKED, "the park position")
    assert min(row[0] for row in board.packets) > -0.2
    operator.mode(Mode.TELEOP, lease=60.0)  # it says that it leaves
    operator.send([-0.5, -0.5, -0.5], times=(1.5,))
    client.wait(lambda: board.packets and near(board.packets[-1], [-0.5] * 3), "the end of the trajectory")


@pytest.mark.ros
def test_of_three_publishers_one_is_obeyed_and_the_others_are_named(
    board, operator, client, start_driver
) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    health: list = []
    client.node.create_subscription(DiagnosticArray, names.DIAGNOSTICS, health.append, 10)
    start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", FLAT)
    operator.ready()

    def all_send() -> None:
        operator.send([-0.5] * 3)
        operator.send([0.0] * 3, source="/other#1")
        operator.send([-1.5] * 3, source="")

    client.wait(lambda: board.packets and near(board.packets[-1], [-0.5] * 3), "the pose", meanwhile=all_send)
    client.wait(
        lambda: operator.status.authority.ignored_commands >= 20, "ignored commands", meanwhile=all_send
    )
    way = np.array(changes(board.packets))[:, 0]
    assert (np.diff(way) <= 0).all(), "it turned back"
    assert way.min() >= -0.5 - EXACT
    assert sorted(operator.status.authority.ignored_sources) == ["", "/other#1"]
    assert "ignored" in operator.status.message

    def values() -> dict[str, str]:
        found = [s for m in health for s in m.status if s.name.endswith("/driver") and s.level == b"\x01"]
        return {v.key: v.value for v in found[-1].values} if found else {}

    client.wait(lambda: "/other#1" in values().get("ignored sources", ""), "the warning", meanwhile=all_send)


@pytest.mark.ros
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_parks_the_servos_and_ends_in_order(number, board, operator, client, start_driver) -> None:
    driver = start_driver(
        f"port:={board.path}",
        "protocol:=legacy",
        "boot_time:=0",
        "park:=[-0.2,-0.3,0,0]",
        "start:=[-1.2,-1.2,-1.2]",
    )
    operator.ready()
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-1.5] * 3),
        "the pose",
        meanwhile=lambda: operator.send([-1.5] * 3),
    )
    moved = len(board.packets)
    assert driver.stop(number) == 0
    assert "Traceback" not in driver.log
    park = LegacyProtocol().decode(LegacyProtocol().encode([-0.2, -0.3, 0.0]))
    client.wait(lambda: board.packets[-1] == park, "the park position")
    way = np.array(board.packets[moved - 1 :])
    assert len(changes(way)) > 10  # 1.5 rad at 4 rad/s, in steps
    assert np.abs(np.diff(way, axis=0)).max() <= LONGEST_STEP


@pytest.mark.ros
def test_parking_takes_no_longer_than_allowed(board, operator, client, start_driver) -> None:
    driver = start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", "angle_speed:=0.05",
                          "start:=[-1,-1,-1]", "park_time_max:=0.3")  # fmt: skip
    operator.ready()
    client.wait(lambda: board.packets, "the first packet", meanwhile=lambda: operator.send([-1.0] * 3))
    assert driver.stop() == 0
    warning = messages.line_naming(driver.log, "park_time_max", "0.3 s", "rad")
    left_at = [float(angle) for angle in re.findall(r"-\d\.\d{3}\b", warning)]
    assert len(left_at) == 3 and -1.0 <= min(left_at) <= max(left_at) < -0.9  # the whole way would take 20 s
    assert board.packets[-1][0] < -0.9


@pytest.mark.ros
def test_a_failure_while_running_parks_too(board, operator, client, start_driver) -> None:
    from std_srvs.srv import Trigger

    code = (
        "import sys, tests.driver.uno; from tripod_driver import node\n"
        "def fail(*_): raise RuntimeError('a defect')\n"
        "node.DriverNode._on_stop = fail\n"
        "sys.exit(node.main(sys.argv[1:]))"
    )
    driver = start_driver(f"port:={board.path}", "protocol:=legacy", "boot_time:=0", program=("-c", code))
    operator.ready()
    client.wait(
        lambda: board.packets and near(board.packets[-1], [-0.5] * 3),
        "the pose",
        meanwhile=lambda: operator.send([-0.5] * 3),
    )
    service = client.node.create_client(Trigger, names.ROBOT_STOP)
    client.wait(service.service_is_ready, "the service")
    service.call_async(Trigger.Request())
    client.wait(lambda: driver.process.poll() is not None, "the end")
    assert driver.process.returncode == 1
    messages.line_naming(driver.log, "driver", "stopped", "RuntimeError", "a defect")
    client.wait(lambda: board.packets[-1] == PARKED, "the park position")


# simulated time -------------------------------------------------------------------------------------------


@pytest.mark.ros
def test_a_clock_that_stands_still_holds_no_servo_on_a_command_that_is_dead(
    board, operator, client, start_driver
) -> None:
    """/clock ends in the midst of a trajectory of ten seconds: the servos hold, it is said why, and then they park."""
    from rosgraph_msgs.msg import Clock

    words = ("protocol:=legacy", "boot_time:=0", "park_after:=0.5", FLAT, "use_sim_time:=true")
    start_driver(f"port:={board.path}", *words)
    clock = client.node.create_publisher(Clock, "/clock", 10)
    ticks = itertools.count()

    def tick() -> None:
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(100 * 10**9 + 20_000_000 * next(ticks), 10**9)
        clock.publish(message)

    client.wait(clock.get_subscription_count, "the driver at /clock")
    client.wait(lambda: operator.statuses and operator.status.state >= 2, "the driver", meanwhile=tick)
    operator.ready()
    operator.send([-1.5] * 3, times=(10.0,))
    client.wait(lambda: board.packets and board.packets[-1][0] < -0.15, "the motion", meanwhile=tick)
    bad = Clock()
    bad.clock.sec = -1
    clock.publish(bad)  # does not end it
    operator.wait_state(operator.status.HOLDING, "the hold")
    messages.assert_names(operator.status.message, "/clock", "not advance")
    operator.wait_state(operator.status.PARKED, "the way to the park position")
    assert min(p[0] for p in board.packets) > -1.2, "the trajectory went on"
    client.wait(lambda: near(board.packets[-1], PARKED), "the park position")
    client.wait(lambda: not operator.status.message, "the end of the complaint", meanwhile=tick)


@pytest.mark.ros
def test_another_that_publishes_the_same_topics_is_told(client, namespace, operator, start_driver) -> None:
    drivers = [start_driver("port:=mock") for _ in range(2)]
    client.wait(
        lambda: all(
            messages.lines_naming(driver.log, f"{namespace}/driver", "same topics") for driver in drivers
        ),
        "both warnings",
    )
