"""The node from outside: starts, says where the page is, does what people press, and leaves in order."""

import socket
import time
import urllib.request
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

import rclpy
from geometry_msgs.msg import Point, PoseStamped
from sensor_msgs.msg import JointState
from shape_msgs.msg import Mesh, MeshTriangle
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint
from tripod_msgs.msg import ControlMode, Field, Forces, RobotStatus, SimStatus

from tests.domains import own_domain
from tests.messages import line_naming, lines_naming, raises_naming
from tests.view.fake_browser import FakeBrowser
from tests.view.shown_scene import show, told
from tests.view.stage import DEADLINE, Stage, View
from tripod_graph import names
from tripod_graph.joint import Joint
from tripod_graph.qos import LATCHED, RELIABLE
from tripod_view.body import BodyError
from tripod_view.messages import LONGEST_NAME, ForcesError, groups_of, maze_of

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    """One domain for all tests here: they share a page."""
    with own_domain() as number:
        yield number


def test_it_says_where_the_page_is_serves_it_and_stops_in_order(domain: int) -> None:
    view = View(domain, "port:=0")
    try:
        url, _ = view.page()
        with urllib.request.urlopen(url, timeout=DEADLINE) as answer:
            assert b"<!doctype html>" in answer.read(200).lower()
        [arguments, environment] = (
            Path(f"/proc/{view.process.pid}/{name}").read_text() for name in ("cmdline", "environ")
        )
    finally:
        code, errors = view.stop()
    assert (code, "Traceback" in errors) == (0, False)
    base, _, token = url.rpartition("/")
    line_naming(errors, base, "token", "printed")
    assert token not in errors + arguments + environment  # nor in the log of ROS, a file: it says the same


def test_a_taken_port_is_reported_with_the_one_that_it_took(domain: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen(1)
        taken = other.getsockname()[1]
        view = View(domain, f"port:={taken}")
        try:
            url, printed = view.page()
        finally:
            code, errors = view.stop()
    port = int(url.split(":")[2].split("/")[0])
    assert port > taken
    named = (f"port {taken}", "in use", f"port {port}")
    line_naming(printed, *named)
    line_naming(errors, *named)  # the log
    assert code == 0


def test_bad_parameters_are_refused_by_name(domain: int) -> None:
    refusals = [
        ("port:=70000", ("'port'", 70000, "0 to 65535")),
        ("rate:=fast", ("'rate'", "'fast'", "float")),
        ("target_low:=[0.5, 0.0, 0.0]", ("target_low [0.5, 0.0, 0.0]", "target_high")),
        ("colour:=red", ("'colour'", "unknown")),
    ]
    refused = [(View(domain, parameter), named) for parameter, named in refusals]  # all at once
    for view, named in refused:
        code, errors = view.end()
        assert code == 2
        line_naming(errors, *named)
        assert "Traceback" not in errors


@pytest.fixture(scope="module")
def context(domain: int) -> Iterator[rclpy.Context]:
    made = rclpy.Context()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        rclpy.init(context=made, domain_id=domain)
        yield made
    made.try_shutdown()


@pytest.fixture(scope="module")
def stage(context: rclpy.Context) -> Iterator[Stage]:
    made = Stage(context)
    yield made
    code, errors = made.close()
    assert (code, "Traceback" in errors) == (0, False)


@pytest.fixture
def browser(stage: Stage) -> Iterator[FakeBrowser]:
    stage.sim.spoil, stage.sim.silent = "", False
    with stage.browser() as opened:
        yield opened
    stage.wait(lambda: stage.watchers() == 0)


def longest(wait: Callable[[Callable[[], bool]], object], count: Callable[[], int], more: int) -> float:
    """Return the longest of the times [s] in which so many `more` came: what was held up comes faster later."""
    times = []
    for _ in range(3):
        before, began = count(), time.monotonic()
        wait(lambda before=before: count() >= before + more)
        times.append(time.monotonic() - began)
    return max(times)


def angles(message: object) -> list[float]:
    return list(message.points[-1].positions)


def test_it_draws_at_its_rate_and_only_while_somebody_looks(stage: Stage) -> None:
    assert stage.watchers() == 0
    with stage.browser() as browser:
        assert stage.watchers() == 1
        assert 30 / longest(browser.wait, browser.pictures, 30) < 33  # at most 30 Hz of the 60 that come
        assert len(browser.changes("/bodies/0")) == 1
        assert [node["path"] for node in browser.nodes.values() if node.get("deforms")] == ["/bodies/0"]
    stage.wait(lambda: stage.watchers() == 0)
    with stage.browser():
        pass


def test_what_leaves_the_picture_is_followed_where_nobody_has_moved_the_camera(
    stage: Stage, browser: FakeBrowser
) -> None:
    nodes, triangles = stage.sim.body
    before = browser.wait(lambda: browser.cameras(fit=True))
    radius = before[-1]["radius"]
    stage.sim.body = nodes - [0, 0, 0.4], triangles
    browser.wait(
        lambda: browser.cameras(fit=False) and browser.cameras(fit=False)[-1]["radius"] > 1.5 * radius
    )
    stage.sim.body = nodes, triangles
    assert browser.cameras(fit=True) == before


def test_a_page_that_hears_nobody_shows_no_robot(domain: int) -> None:
    view = View(domain, "port:=0")
    url, _ = view.page()
    with FakeBrowser(url) as browser:
        scene = browser.wait(lambda: browser.value("scene"))
        assert (scene["known"], scene["joints"], scene["target"]) == (False, False, False)
        assert browser.position("/arms/0") is None
    assert view.stop()[0] == 0


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        ("nan", ("node 3", "not finite")),
        ("size", ("240 coordinates", "81 nodes")),
        ("topology", ("topology id",)),
    ],
)
def test_body_states_that_do_not_fit_are_skipped_and_shown(
    stage: Stage, browser: FakeBrowser, spoil: str, named: tuple[str, ...]
) -> None:
    stage.sim.spoil = spoil
    browser.wait(lambda: lines_naming(browser.text(), "body states", "skipped", *named))
    stage.sim.spoil = ""
    drawn = browser.pictures()
    browser.wait(lambda: browser.pictures() > drawn + 3)


def test_a_mesh_that_changes_is_rebuilt(stage: Stage, browser: FakeBrowser) -> None:
    meshes = len(browser.changes("/bodies/0"))
    nodes, triangles = stage.sim.body
    stage.sim.body = nodes, np.ascontiguousarray(triangles[::-1])
    browser.wait(lambda: lines_naming(browser.text(), "topology id", "mesh"))
    stage.sim.publish_mesh()
    browser.wait(lambda: len(browser.changes("/bodies/0")) > meshes)
    drawn = browser.pictures()
    browser.wait(lambda: browser.pictures() > drawn + 3)


def test_maze_and_ball_come_and_go_with_the_simulator(stage: Stage, browser: FakeBrowser) -> None:
    assert not browser.node("/effector/maze")
    stage.sim.publish_game(True, 0.002)
    browser.wait(lambda: browser.node("/effector/maze") and browser.node("/ball/0"))
    assert (
        browser.node("/effector/maze")["parent"] == browser.node("/effector")["number"]
    )  # so that it rides on it
    radius = np.linalg.norm(browser.node("/ball/0")["vertices"], axis=1).max()
    assert radius == pytest.approx(0.002, rel=0.01)
    assert not browser.node("/ball")["visible"]  # nobody has said where it is
    stage.wait(lambda: stage.sim.publish_ball(0.01, -0.02, 0.03) or browser.node("/ball")["visible"])
    browser.wait(lambda: browser.position("/ball") == [0.01, -0.02, 0.03])
    assert browser.node("/ball")["pose"][3:] == pytest.approx([0, 0, 0.6, 0.8])
    stage.sim.publish_game(False)
    browser.wait(lambda: not browser.node("/effector/maze") and not browser.node("/ball"))


def test_a_maze_is_read_and_an_empty_one_is_none() -> None:
    corners = [Point(x=0.01), Point(y=0.01), Point(z=0.008)]
    maze = maze_of(Mesh(vertices=corners, triangles=[MeshTriangle(vertex_indices=[0, 2, 1])]))
    assert maze is not None
    assert maze.nodes.tolist() == [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.008]]
    assert maze.triangles.tolist() == [[0, 2, 1]]
    assert maze_of(Mesh()) is None
    with raises_naming(BodyError, "node 1", "has 1"):
        maze_of(Mesh(vertices=[Point()], triangles=[MeshTriangle(vertex_indices=[0, 0, 1])]))


@pytest.mark.parametrize(
    ("kind", "sizes", "named"),
    [
        (1, (0.1, 0.1, 0.1), ("type 1", "3 dimensions", "type 2")),
        (2, (float("nan"),), ("radius", "ball", "nan m", "0 to 1 m")),
        (2, (-0.002,), ("radius", "ball", "-0.002 m")),
    ],
)
def test_a_ball_that_cannot_be_is_refused(
    stage: Stage, browser: FakeBrowser, kind: int, sizes: tuple[float, ...], named: tuple[str, ...]
) -> None:
    stage.sim.publish_game(False, *sizes, kind=kind)
    browser.wait(lambda: lines_naming(browser.text(), *named))
    stage.sim.publish_game(False)


def test_sliders_command_only_in_control_and_start_where_the_joints_are(
    stage: Stage, browser: FakeBrowser
) -> None:
    stage.sim.jump_to(-0.25, -0.25, -0.25, 0.0)
    browser.wait(lambda: browser.value("joints") and browser.shown(0) == -14.3)
    browser.slide(0, 20.0)  # disabled on the screen, but a browser may send it
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    stage.sim.commands.clear()
    stage.wait(lambda: len(stage.sim.commands) >= 3)
    assert stage.sim.commands[0].joint_names == list(names.SERVOS)
    assert angles(stage.sim.commands[0]) == pytest.approx([-0.25] * 3)
    browser.slide(1, -45.0)
    stage.wait(lambda: angles(stage.sim.commands[-1]) == pytest.approx([-0.25, -np.pi / 4, -0.25]))
    browser.slide(1, 9e9)
    stage.wait(lambda: angles(stage.sim.commands[-1])[1] == pytest.approx(0.6))
    refusal = ("servo 1", "9000000000.0 degrees", "-120.3 to 34.4")
    browser.wait(lambda: lines_naming(browser.text(), *refusal))
    for nonsense in (float("nan"), float("inf"), "far"):
        browser.slide(1, nonsense)
    browser.slide(2, 10.0)
    stage.wait(lambda: angles(stage.sim.commands[-1]) == pytest.approx([-0.25, 0.6, np.radians(10.0)]))
    assert 10 / longest(stage.wait, lambda: len(stage.sim.commands), 10) < 22  # 20 Hz
    other = ControlMode(mode=ControlMode.TELEOP, source="keyboard", lease=600.0)
    other.header.stamp = stage.sim.get_clock().now().to_msg()
    stage.sim.mode.publish(other)
    browser.wait(lambda: lines_naming(browser.text(), "TELEOP", "by keyboard"))
    before, pictures = len(stage.sim.commands), browser.pictures()
    browser.wait(lambda: browser.pictures() > pictures + 20)
    assert len(stage.sim.commands) <= before + 1


def test_a_servo_a_cable_and_a_chamber_are_commanded_in_one_message(
    stage: Stage, browser: FakeBrowser
) -> None:
    others = Joint("tendon", "m", 0.0, 0.03, 0.03), Joint("air", "Pa", 0.0, 30e3, 30e3)
    stage.sim.have_joints(1, others)
    browser.wait(lambda: [kind["servo"] for kind in browser.value("kinds") or []] == [True, False, False])
    browser.wait(lambda: browser.value("joints") and len(browser.value("joints")["asked"]) == 3)
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    stage.wait(lambda: len(stage.sim.commands) >= 3)
    for asked in ({"servo": 0, "degrees": -10.0}, {"joint": 1, "value": 12.5}, {"joint": 2, "value": 2.0}):
        browser.tell(**asked)

    def sent() -> list[float]:
        point = stage.sim.commands[-1].points[-1] if stage.sim.commands else JointTrajectoryPoint()
        return [*point.positions, *point.effort]

    efforts = [0.0, 0.0, 2e3]
    stage.wait(
        lambda: sent()[:3] == pytest.approx([np.radians(-10.0), 0.0125, 0.0]) and sent()[-3:] == efforts,
        lambda: str((sent(), browser.text())),
    )
    assert list(stage.sim.commands[-1].joint_names) == ["servo_0", "tendon", "air"]
    browser.press("STOP")
    stage.sim.have_joints(3, ())
    browser.wait(lambda: [kind["servo"] for kind in browser.value("kinds")] == [True] * 3)


def test_the_working_pose_is_a_slow_path_that_a_slider_ends(stage: Stage, browser: FakeBrowser) -> None:
    stage.sim.commands.clear()
    browser.press("working pose")  # takes control too
    path = stage.wait(lambda: next((c for c in stage.sim.commands if len(c.points) > 1), None))
    assert path.joint_names == [*names.SERVOS, names.SLIDE]
    assert angles(path) == pytest.approx(names.WORKING_POSE)
    assert path.points[-1].time_from_start.sec >= 2
    browser.wait(lambda: lines_naming(browser.text(), "working pose"))
    count = len(stage.sim.commands)
    browser.slide(0, -30.0)
    stage.wait(lambda: len(stage.sim.commands) > count)
    assert angles(stage.sim.commands[count])[0] == pytest.approx(np.radians(-30.0))


def last(stage: Stage) -> list[float]:
    """Return where the newest command ends [rad, m], empty before the first."""
    return angles(stage.sim.commands[-1]) if stage.sim.commands else []


@pytest.mark.parametrize("who", ["page", "others"])
def test_a_reset_lets_the_sliders_ask_for_the_start_of_the_scene(
    stage: Stage, browser: FakeBrowser, who: str
) -> None:
    show(stage.sim, "maze")
    browser.wait(lambda: browser.value("scene")["name"] == "maze")
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    browser.slide(0, -30.0)
    stage.wait(lambda: last(stage)[:1] == pytest.approx([np.radians(-30.0)]))
    if who == "page":
        browser.tell(sim="reset")
    else:
        stage.sim.began = time.monotonic()
    stage.wait(lambda: last(stage) == pytest.approx(names.WORKING_POSE))
    browser.wait(lambda: browser.shown(0) == pytest.approx(np.degrees(names.WORKING_POSE[0]), abs=0.1))
    stage.sim.began = 0.0
    browser.press("STOP")


def test_a_reset_ends_the_following_of_the_target(stage: Stage, browser: FakeBrowser) -> None:
    show(stage.sim, "maze")
    browser.wait(lambda: browser.value("scene")["name"] == "maze")
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    browser.press("IK")
    stage.wait(lambda: stage.mode() == (ControlMode.IK, "view"))
    stage.sim.commands.clear()
    browser.tell(sim="reset")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    stage.wait(lambda: stage.sim.commands)
    assert angles(stage.sim.commands[0]) == pytest.approx(names.WORKING_POSE)
    browser.press("STOP")


def test_a_simulator_that_comes_back_after_silence_resets_nothing(stage: Stage, browser: FakeBrowser) -> None:
    show(stage.sim, "maze")
    browser.wait(lambda: browser.value("scene")["name"] == "maze")
    stage.sim.jump_to(-0.5, -0.5, -0.5, 0.0)
    browser.wait(lambda: browser.shown(0) == pytest.approx(np.degrees(-0.5), abs=0.1))
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    stage.wait(lambda: stage.sim.commands and angles(stage.sim.commands[-1]) == pytest.approx([-0.5] * 3))
    stage.sim.silent = True
    stage.wait(lambda: not browser.value("run"))
    count = len(stage.sim.commands)
    stage.sim.publish_joints(np.array([-0.5, -0.5, -0.5, 0.0]))
    stage.wait(lambda: len(stage.sim.commands) > count)
    stage.sim.began, stage.sim.silent = time.monotonic(), False
    pictures = browser.pictures()
    browser.wait(lambda: browser.pictures() > pictures + 20)
    assert angles(stage.sim.commands[-1]) == pytest.approx([-0.5] * 3)
    stage.sim.began = 0.0
    browser.press("STOP")


def test_a_reset_stops_a_real_robot(stage: Stage, browser: FakeBrowser) -> None:
    show(stage.sim, "maze")
    robot = stage.sim.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    timer = stage.sim.create_timer(
        0.1, lambda: robot.publish(RobotStatus(port="/dev/ttyUSB0", state=RobotStatus.ACTIVE))
    )
    browser.wait(lambda: browser.value("run") and not browser.value("run")["simulated"])
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    browser.slide(0, -30.0)
    stage.wait(lambda: last(stage)[:1] == pytest.approx([np.radians(-30.0)]))
    browser.tell(sim="reset")
    stage.wait(lambda: stage.mode() == (ControlMode.STOP, "view"))
    browser.wait(lambda: lines_naming(browser.text(), "robot", "stopped", "control"))
    assert angles(stage.sim.commands[-1])[0] == pytest.approx(np.radians(-30.0))
    timer.cancel()
    stage.destroy(robot)
    browser.wait(lambda: browser.value("run") and browser.value("run")["simulated"])


def test_a_driver_without_the_slide_leaves_it_where_the_simulator_said_last(
    stage: Stage, browser: FakeBrowser
) -> None:
    stage.sim.jump_to(-0.25, -0.25, -0.25, 0.02)
    browser.wait(lambda: browser.value("joints") and browser.value("joints")["slide"] == 20.0)
    stage.sim.silent = True  # as while it is paused
    robot = stage.sim.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
    state = JointState(name=list(names.SERVOS), position=[-0.5] * 3)
    timer = stage.sim.create_timer(0.1, lambda: robot.publish(state))
    browser.wait(lambda: browser.shown(0) == pytest.approx(np.degrees(-0.5), abs=0.1))
    assert browser.value("joints")["slide"] == 20.0
    timer.cancel()
    stage.destroy(robot)


def test_stop_is_published_at_once(stage: Stage, browser: FakeBrowser) -> None:
    browser.press("TELEOP")
    stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
    stage.wait(lambda: len(stage.sim.commands) > 3)
    before = len(stage.sim.commands)
    browser.press("STOP")
    stage.wait(lambda: stage.mode() == (ControlMode.STOP, "view"))
    assert len(stage.sim.commands) - before <= 10  # half a second, by the page's own 20 Hz
    stage.wait(lambda: lines_naming(browser.text(), "STOP", "the page"))


def test_when_the_last_browser_leaves_in_control_the_robot_stops(stage: Stage) -> None:
    with stage.browser() as first:
        second = stage.browser()
        first.press("IK")
        stage.wait(lambda: stage.mode() == (ControlMode.IK, "view"))
        count = len(stage.sim.modes)
        second.close()
        drawn = first.pictures()
        first.wait(lambda: first.pictures() > drawn + 15)
        assert len(stage.sim.modes) == count  # one is still there
    stage.wait(lambda: stage.mode() == (ControlMode.STOP, "view"))
    with stage.browser() as again:  # who comes back reads why
        again.wait(lambda: lines_naming(again.text(), "connection", "control"))


def test_when_the_browser_in_control_is_silent_the_robot_stops(stage: Stage) -> None:
    browser = stage.browser()
    browser.press("IK")
    stage.wait(lambda: stage.mode() == (ControlMode.IK, "view"))
    browser.freeze()
    stage.wait(lambda: stage.mode() == (ControlMode.STOP, "view"))


def test_a_browser_that_leaves_out_of_control_changes_nothing(stage: Stage) -> None:
    with stage.browser() as browser:
        other = ControlMode(mode=ControlMode.IK, source="script", lease=600.0)
        other.header.stamp = stage.sim.get_clock().now().to_msg()
        stage.sim.mode.publish(other)
        browser.wait(lambda: lines_naming(browser.text(), "IK", "by script"))
    stage.wait(lambda: stage.watchers() == 0)
    assert stage.mode() == (ControlMode.IK, "script")


def test_a_drag_publishes_targets_within_the_box_and_shuts_others_out(
    stage: Stage, browser: FakeBrowser
) -> None:
    def newest() -> list[float]:
        p = stage.sim.targets[-1].pose.position
        return [p.x, p.y, p.z]

    def publish_other() -> None:
        message = PoseStamped()
        message.header.frame_id, message.header.stamp = names.WORLD, stage.sim.get_clock().now().to_msg()
        message.pose.position.y = -0.015
        stage.sim.target.publish(message)

    stage.sim.targets.clear()
    browser.grab()
    browser.drag(0.01, 0.005, -0.002)
    stage.wait(lambda: stage.sim.targets and newest() == [0.01, 0.005, -0.002])
    target = stage.sim.targets[-1]
    assert (target.header.frame_id, target.pose.orientation.w) == (names.WORLD, 1.0)
    browser.drag(5.0, -5.0, 5.0)
    stage.wait(lambda: newest() == [0.02, -0.02, 0.015])
    count = len(stage.sim.targets)
    for nonsense in ((float("nan"), 0, 0), (0, float("inf"), 0)):
        browser.drag(*nonsense)
    browser.wait(lambda: lines_naming(browser.text(), "messages", "refused", "dragged target"))
    assert len(stage.sim.targets) == count
    publish_other()
    stage.wait(lambda: newest() == [0.0, -0.015, 0.0])
    browser.drop()
    browser.wait(lambda: browser.position("/target_handle") == pytest.approx([0.02, -0.02, 0.015]))
    publish_other()
    browser.wait(lambda: browser.position("/target_handle") == pytest.approx([0.0, -0.015, 0.0]))


def test_the_handle_turns_where_the_goal_is_an_orientation(stage: Stage, browser: FakeBrowser) -> None:
    def may_turn() -> bool:
        return browser.node("/target_handle")["turns"]

    goals = stage.sim.create_publisher(String, names.IK_GOAL, LATCHED)
    browser.wait(lambda: not may_turn())
    goals.publish(String(data="orientation"))
    browser.wait(may_turn)
    stage.sim.targets.clear()
    browser.grab()
    browser.drag(0.0, 0.0, 0.0, turn=(0.6, 0.0, 0.0, 0.8))
    stage.wait(lambda: stage.sim.targets)
    q = stage.sim.targets[-1].pose.orientation
    assert (q.w, q.x, q.y, q.z) == pytest.approx((0.8, 0.6, 0.0, 0.0))
    browser.drop()
    goals.publish(String(data="position"))
    browser.wait(lambda: not may_turn())
    stage.destroy(goals)


def test_inverse_kinematics_starts_at_the_handle_which_rides_on_the_effector(
    stage: Stage, browser: FakeBrowser
) -> None:
    def rides() -> bool:
        seen = [pose[2] for pose in browser.changes("/target", "pose")[-10:]]
        return len(set(seen)) > 5  # the effector of the fake goes up and down

    browser.press("bring target to effector")
    browser.wait(rides)  # the echo of the own target does not pin it
    stage.sim.targets.clear()
    browser.press("IK")
    stage.wait(lambda: stage.sim.targets and stage.mode() == (ControlMode.IK, "view"))
    p = stage.sim.targets[-1].pose.position
    assert (p.x, p.y) == (0.0, 0.0)
    assert abs(p.z) < 0.01
    browser.grab()
    browser.drag(0.01, 0.0, 0.0)
    browser.drop()
    browser.wait(lambda: browser.position("/target") == [0.01, 0.0, 0.0])
    browser.press("STOP")
    browser.wait(lambda: browser.position("/target")[0] == 0.0)
    browser.wait(rides)


def test_messages_with_nonsense_are_refused_and_shown(stage: Stage, browser: FakeBrowser) -> None:
    bad = PoseStamped()
    bad.header.frame_id = "moon"
    stage.sim.target.publish(bad)
    browser.wait(lambda: lines_naming(browser.text(), "frame 'moon'", "'world'"))
    bad.header.frame_id, bad.pose.position.x = names.WORLD, float("nan")
    stage.sim.target.publish(bad)
    browser.wait(lambda: lines_naming(browser.text(), "position [nan", "finite", "not zero"))
    stage.sim.mode.publish(ControlMode(mode=77, source="x"))
    browser.wait(lambda: lines_naming(browser.text(), "control mode 77", "unknown"))


def test_the_arms_of_another_scene_do_not_stand_as_those_before(stage: Stage, browser: FakeBrowser) -> None:
    def turn(path: str) -> list[float]:
        found = browser.node(path)
        return list(found["pose"][3:]) if found else []

    stage.sim.jump_to(-1.0, -1.0, -1.0, 0.02)
    show(stage.sim, "tripod")
    browser.wait(lambda: browser.value("scene")["name"] == "tripod")
    browser.wait(lambda: turn("/arms/0") and turn("/arms/0") != [0, 0, 0, 1])
    stage.sim.silent = True
    ticks = stage.sim.ticks
    stage.wait(lambda: stage.sim.ticks > ticks + 1)
    stage.sim.publish_joints(np.array([-0.9, -0.9, -0.9, 0.02]))
    turned = pytest.approx(np.cos(0.45), abs=1e-3)
    browser.wait(lambda: turn("/arms/0")[3] == turned)  # what was on its way has arrived before the scene
    before = browser.node("/arms/0")["number"]
    stage.sim.jump_to(0.0, 0.0, 0.0, 0.0)
    show(stage.sim, "cross")
    browser.wait(lambda: browser.value("scene")["name"] == "cross")
    browser.wait(lambda: browser.node("/arms/0")["number"] != before)
    browser.wait(lambda: turn("/arms/0") == [0, 0, 0, 1])


def test_a_maze_stays_on_the_effector_that_another_scene_brings(stage: Stage, browser: FakeBrowser) -> None:
    def rides() -> bool:
        nodes = [browser.node(f"/effector{end}") for end in ("", "/maze", "/marks")]
        return None not in nodes and {node["parent"] for node in nodes[1:]} == {nodes[0]["number"]}

    stage.sim.publish_game(True, 0.002)
    before = browser.wait(lambda: browser.node("/effector/maze"))
    show(stage.sim, "maze")
    browser.wait(lambda: browser.value("scene")["name"] == "maze")
    browser.wait(lambda: rides() and browser.node("/effector")["number"] != before["parent"])
    browser.wait(lambda: browser.node("/effector/marks/goal"))
    stage.sim.publish_game(False)


def test_numbers_that_are_none_are_refused_by_name(stage: Stage, browser: FakeBrowser) -> None:
    ranges = stage.sim.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
    short = RobotStatus(joint_names=names.SERVOS, lower=[-1.0] * 2, upper=[0.0] * 3, speed=[1.0] * 3)
    stage.wait(lambda: ranges.publish(short) or lines_naming(browser.text(), "range", "2 servos"))
    status = stage.sim.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
    figures = stage.sim.create_publisher(String, names.SIM_FIGURES, RELIABLE)
    for name in ("time", "dt", "real_time_factor", "step_time_median", "step_time_p99", "time_error"):
        stage.wait(
            lambda name=name: (
                status.publish(SimStatus(**{name: np.inf})) or lines_naming(browser.text(), name, "inf")
            )
        )
    for text, named in (
        ('{"a": NaN}', ("number", "NaN")),
        ('{"a": 1e999}', ("1e999",)),
        ("[" * 10000, ("[", "JSON")),
    ):
        stage.wait(
            lambda text=text, named=named: (
                figures.publish(String(data=text)) or lines_naming(browser.text(), *named)
            )
        )
    stage.destroy(status, figures, ranges)


def test_each_of_several_bodies_has_a_colour_of_its_own(stage: Stage, browser: FakeBrowser) -> None:
    def colours() -> set[tuple[int, ...]]:
        bodies = [browser.node(f"/bodies/{i}") for i in range(2)]
        return {tuple(body["colour"]) for body in bodies if body}

    show(stage.sim, "two_cloths")
    browser.wait(lambda: browser.value("scene")["name"] == "two_cloths")
    browser.wait(lambda: len(colours()) == 2)


def test_bodies_may_be_called_like_what_else_is_drawn(stage: Stage, browser: FakeBrowser) -> None:
    table, drawn = told("stack")[0], ("ground", "effector", "ball", "target", "world", "obstacles/0", "../a")
    show(stage.sim, "stack")
    browser.wait(lambda: browser.value("scene")["name"] == "stack")
    count = table["parts"][0]["count"]
    nodes, triangles = told("stack")[2][:count], told("stack")[3]
    stage.sim.body = nodes, triangles[(triangles < count).all(axis=1)]
    stage.sim.publish_mesh()
    for name in drawn:
        meshes = len(browser.changes("/bodies/0"))
        part = {"name": name, "kind": "solid", "first": 0, "count": count}
        stage.sim.publish_picture({**table, "name": f"with {name}", "parts": [part]})
        browser.wait(lambda meshes=meshes: len(browser.changes("/bodies/0")) > meshes)
        pictures = browser.pictures()
        browser.wait(lambda pictures=pictures: browser.pictures() > pictures + 3)


def test_what_falls_away_from_the_others_is_left_out_and_told(stage: Stage, browser: FakeBrowser) -> None:
    table = told("stack")[0]
    show(stage.sim, "stack")
    browser.wait(lambda: browser.value("scene")["name"] == "stack")
    nodes, triangles = stage.sim.body
    browser.wait(lambda: browser.value("notice") == [])
    near = browser.wait(lambda: browser.cameras(fit=True))[-1]["radius"]
    one = np.arange(len(nodes)) < table["parts"][0]["count"]
    stage.sim.body = nodes - one[:, None] * [0, 0, 50.0], triangles
    browser.wait(lambda: lines_naming(browser.text(), "out of sight", "body", "far away"))
    browser.wait(lambda: [browser.node(f"/bodies/{i}")["fits"] for i in range(2)] == [False, True])
    assert (
        max(camera["radius"] for camera in browser.cameras(fit=False)[-1:] or [{"radius": near}]) < 2 * near
    )
    stage.sim.body = nodes, triangles
    browser.wait(lambda: browser.value("notice") == [] and browser.node("/bodies/0")["fits"])


def test_a_page_that_is_stopped_in_control_leaves_the_robot_stopped(context: rclpy.Context) -> None:
    stage = Stage(context)
    try:
        with stage.browser() as browser:
            browser.press("TELEOP")
            stage.wait(lambda: stage.mode() == (ControlMode.TELEOP, "view"))
            stage.view.ask_to_stop()
            stage.wait(lambda: stage.mode() == (ControlMode.STOP, "view"))
    finally:
        code, errors = stage.close()
    assert (code, "Traceback" in errors) == (0, False)


def test_fields_and_forces_are_heard_only_while_a_browser_shows_them(
    stage: Stage, browser: FakeBrowser
) -> None:
    show(stage.sim, "silicone")
    browser.wait(lambda: "von_mises" in [field["name"] for field in browser.values.get("fields", [])])
    browser.wait(lambda: browser.values["scene"]["name"] == "silicone")
    stress, forces = (
        stage.sim.create_publisher(kind, topic, RELIABLE)
        for kind, topic in ((Field, names.field_topic("von_mises")), (Forces, names.FORCES))
    )
    count, crc = len(stage.sim.body[0]), crc32(stage.sim.body[1].tobytes())
    values = array("f", np.linspace(0, 1e4, count).tolist())
    values[3] = np.inf

    def nodes(kind: str) -> list[dict[str, Any]]:
        return [node for node in list(browser.nodes.values()) if node["kind"] == kind]

    def refused(publish: Callable[[], None]) -> None:
        """Publish until another message is refused; the page shows what it showed."""
        before = browser.pictures()
        publish()
        browser.wait(lambda: browser.pictures() > before + 3)
        assert [len(node["values"]) for node in nodes("field")] == [count]

    try:
        assert (stress.get_subscription_count(), forces.get_subscription_count()) == (0, 0)
        browser.send(show="von_mises", forces=False)
        stage.wait(stress.get_subscription_count)
        assert forces.get_subscription_count() == 0
        good = Field(topology_id=crc, unit="Pa", values=values)
        stage.wait(lambda: stress.publish(good) or nodes("field"))
        [field] = nodes("field")
        assert field["path"] == "/bodies/0/von_mises"
        np.testing.assert_allclose(field["values"][4:], values[4:], rtol=1e-6)
        assert np.isnan(field["values"][3])
        for bad in (
            Field(topology_id=crc + 1, unit="Pa", values=values),
            Field(topology_id=crc, unit="m", values=values),
            Field(topology_id=crc, unit="Pa", values=values[:-1]),
            Field(topology_id=crc, unit="Pa"),
        ):
            refused(lambda bad=bad: stress.publish(bad))
        browser.send(show="", forces=True)
        stage.wait(lambda: stress.get_subscription_count() == 0 and forces.get_subscription_count())
        browser.wait(lambda: not nodes("field"))
        two = Forces(names=["reaction", "load"], units=["N", "N"], counts=[1, 1])
        two.points, two.vectors = array("d", range(6)), array("d", range(6, 12))
        stage.wait(lambda: forces.publish(two) or nodes("arrows"))
        told = {
            node["name"]: (node["unit"], list(node["points"]), list(node["vectors"]))
            for node in nodes("arrows")
        }
        assert told == {"reaction": ("N", [0, 1, 2], [6, 7, 8]), "load": ("N", [3, 4, 5], [9, 10, 11])}
        browser.send(show="no_such", forces=False)
        stage.wait(lambda: forces.get_subscription_count() == 0)
        browser.wait(lambda: not nodes("arrows"))
        with FakeBrowser(stage.url) as other:
            other.send(show="von_mises", forces=False)
            stage.wait(stress.get_subscription_count)
        stage.wait(lambda: stress.get_subscription_count() == 0)
    finally:
        stage.destroy(stress, forces)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"counts": [2]}, ("2 forces",)),
        ({"counts": [1, 1]}, ("2 counts",)),
        ({"counts": [4294967295]}, ("4294967295 forces",)),
        ({"names": ["a/b"]}, ("name",)),
        ({"names": ["x" * (LONGEST_NAME + 1)]}, ("name",)),
        ({"units": []}, ("0 units",)),
        ({"points": [0.0, np.nan, 0.0]}, ("coordinate", "not finite")),
        ({"vectors": [np.inf, 0.0, 0.0]}, ("component", "not finite")),
        ({"vectors": [1e300, 0.0, 0.0]}, ("component", "1e+09")),
        ({"vectors": [1.0]}, ("1 components",)),
    ],
)
def test_forces_that_cannot_be_are_refused(change: dict[str, Any], named: tuple[str, ...]) -> None:
    good: dict[str, Any] = {
        "names": ["load"],
        "units": ["N"],
        "counts": [1],
        "points": [0.0] * 3,
        "vectors": [1.0] * 3,
    }
    assert [group.name for group in groups_of(Forces(**good))] == ["load"]
    assert groups_of(Forces()) == ()
    with raises_naming(ForcesError, *named):
        groups_of(Forces(**{**good, **change}))
