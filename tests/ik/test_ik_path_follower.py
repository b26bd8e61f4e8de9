"""A tracker that stands still asks for a way, goes along it, rests at its end and goes on when the target moves."""

import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from tests.ik.plant import SpringRobot
from tests.messages import assert_names, raises_naming
from tripod_ik.errors import IkError
from tripod_ik.joint_path import NEAR_PATH, NO_PATH, JointPath
from tripod_ik.path_follower import PathFollower
from tripod_ik.planner_thread import HANDOVER, PlannerThread
from tripod_ik.problem import build_ik
from tripod_ik.solver import IkSolver
from tripod_ik.tasks import PositionTask, PostureTask
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings

WORKING = np.full(3, -1.4965)
DT = 0.01  # [s]
STOPS, FIRM = np.array([[-1.6, -1.3, -1.4], [-1.2, -1.2, -1.5]]), np.ones(2)


class Robot:
    """A robot that obeys, out of whose reach the target is; its tracker asks for the ways of `answers`."""

    def __init__(self, answers):
        self.plant, self.questions, self.answers = SpringRobot(slide=0.035), [], list(answers)
        self.tracker = Tracker(TrackerSettings(angle_max=-1.0), guide=self.ask)
        self.angles, self.now = WORKING, 0.0
        self.tracker.target = self.plant.rest(WORKING) + np.array([0.0, 0.0, 0.1])

    def ask(self, state, tasks, trail):
        self.questions.append((state, tasks, trail))
        return self.answers.pop(0)

    def run(self, ticks, *, obeys=True):
        steps = []
        for _ in range(ticks):
            steps.append(self.tracker.update(self.plant.state(self.angles), self.now))
            if obeys:
                self.angles = steps[-1].result.command
            self.now += DT
        return steps

    def until_asked(self):
        for _ in range(300):
            if self.questions:
                return
            self.run(1)
        raise AssertionError("nothing was asked")


def from_line(point, start, end):
    """Return how far `point` is from the line between two others."""
    part = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    return float(np.linalg.norm(point - start - part * (end - start)))


def test_it_waits_for_the_answer_goes_straight_from_stop_to_stop_and_rests_there_until_the_target_moves():
    robot = Robot([None] * 5 + [JointPath(STOPS, 1e-3, ("snap",), FIRM)])
    robot.until_asked()
    waiting = robot.run(5)
    assert [step.activity for step in waiting] == [Activity.SEARCHING] * 4 + [Activity.TRACKING]
    start = waiting[-2].result.command
    assert all(question[0] is robot.questions[0][0] for question in robot.questions)
    assert np.ptp([step.result.command for step in waiting[1:-1]], axis=0).max() < 1e-6
    moving = robot.run(80)
    assert not any(step.activity is Activity.SEARCHING for step in moving)
    commands = np.array([start, *(step.result.command for step in moving)])
    assert np.abs(np.diff(commands, axis=0)).max() <= 3.0 * DT + 1e-9
    places = np.array([robot.plant.rest(command) for command in commands])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 1.1 * 0.06 * DT
    for command in commands:
        assert min(from_line(command, start, STOPS[0]), from_line(command, *STOPS)) < 3e-6
    assert min(np.abs(commands - STOPS[0]).max(axis=1)) < 0.03
    assert commands[-1] == pytest.approx(STOPS[-1], abs=1e-9)
    assert {step.activity for step in moving[1:30]} == {Activity.TRACKING}
    assert moving[-1].activity is Activity.CLOSEST
    assert "snap" in moving[-1].result.active_limits
    there = robot.plant.rest(STOPS[-1])
    assert moving[-1].result.residual == pytest.approx(np.linalg.norm(robot.tracker.target - there))
    goal = there + np.array([0.001, 0.0, 0.0])
    robot.tracker.target = goal
    robot.run(60)
    assert robot.plant.rest(robot.angles) == pytest.approx(goal, abs=1e-6)


@pytest.mark.parametrize("answer", [NO_PATH, JointPath(STOPS, 0.2, (), FIRM)])
def test_where_there_is_no_better_pose_it_stays_and_asks_no_more(answer):
    robot = Robot([answer])
    robot.until_asked()
    before = robot.angles
    robot.run(100)
    assert robot.angles == pytest.approx(before, abs=1e-4)
    assert len(robot.questions) == 1


def test_a_way_that_is_blocked_is_given_up():
    robot = Robot([JointPath(STOPS, 1e-3, (), FIRM)])
    robot.until_asked()
    blocked = robot.run(260, obeys=False)
    assert np.abs(blocked[50].result.command - robot.angles).max() > 0.1
    assert np.abs(blocked[-1].result.command - robot.angles).max() < 1e-3


def led(stability_margin, way, *, least_margin=0.0, move=0.0):
    """Return where a way leads after a step from the working pose, and where after the target has moved by `move`."""
    slope = np.array([1.0, 0.0, 0.0])
    state = replace(
        SpringRobot(slide=0.035).state(WORKING),
        stability_margin=stability_margin,
        stability_margin_slope=slope,
    )
    guidance, target = PathFollower(lambda *_: way), np.zeros(6)
    for k in range(3):
        guidance.look(state, [], target, 0.01, k * DT, closest=True)
    found = []
    for k, aimed in ((3, target), (4, target + move * np.eye(6)[0])):
        found.append(
            guidance.command(
                state, WORKING, aimed, k * DT, dt=DT, reach=0.1, speed=0.06, least_margin=least_margin
            )
        )
    return found


def test_a_target_that_moves_while_the_body_calms_down_needs_another_way():
    softer = JointPath(WORKING - np.array([[0.3, 0.0, 0.0]]), 1e-3, (), np.array([0.08]))
    goes, on = led(0.2, softer, move=2e-3)
    assert goes[0] < WORKING[0]
    assert on is not None
    waits, other = led(0.2, softer, least_margin=0.25, move=2e-3)
    assert waits == pytest.approx(WORKING, abs=1e-9)
    assert other is None


def test_out_of_where_the_body_is_soft_it_goes_though_it_swings():
    firmer = JointPath(WORKING - np.array([[0.3, 0.0, 0.0]]), 1e-3, (), np.array([0.28]))
    assert led(0.1, firmer, least_margin=0.15)[0][0] < WORKING[0] - 1e-4


def test_a_way_that_ends_soft_is_gone_slowly_though_the_body_is_firm_where_it_is():
    """It is where it was commanded to be a while ago."""
    soft, hard = (
        JointPath(WORKING - np.array([[0.02, 0.0, 0.0]]), 1e-3, (), np.array([end])) for end in (0.07, 1.0)
    )
    assert led(1.0, hard)[0] == pytest.approx(WORKING - np.array([0.02, 0.0, 0.0]))
    part = (WORKING - led(1.0, soft)[0])[0] / 0.02
    assert part == pytest.approx((1 - 0.063**2) * (1 - np.exp(-DT / 0.04)) / (1 - 0.07**2), rel=1e-6)
    assert led(1.0, soft, least_margin=1.0)[0] == pytest.approx(WORKING, abs=1e-9)


def test_commands_keep_to_the_speed_of_the_effector():
    robot, one = SpringRobot(slide=0.035), Tracker(TrackerSettings(effector_speed=0.02))
    one.target = robot.rest(WORKING) + np.array([0.0, 0.0, 0.006])
    angles, places = WORKING, []
    for k in range(60):
        angles = one.update(robot.state(angles), k * DT).result.command
        places.append(robot.rest(angles))
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / DT
    assert 0.019 < speeds.max() < 0.0215
    assert places[-1] == pytest.approx(one.target, abs=1e-6)
    with raises_naming(IkError, "effector_speed", "0.0 m/s"):
        TrackerSettings(effector_speed=0.0)


class Finder:
    def __init__(self, answer):
        self.answer, self.go = answer, threading.Event()

    def prepare(self):
        self.prepared = True

    def way(self, state, tasks, trail):
        assert self.go.wait(60)
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


@pytest.mark.parametrize(
    ("answer", "named"),
    [
        (JointPath(STOPS, 0.0, (), FIRM), ()),
        (NO_PATH, ("robot", "model")),
        (IkError("no servos"), ("no model", "no servos")),
        (KeyError("x"), ("no model", "KeyError: 'x'")),
    ],
)
def test_a_guide_answers_when_it_knows_and_says_what_it_does(answer, named):
    finder, slides = Finder(answer), []
    guide = PlannerThread(lambda slide: slides.append(slide) or finder)
    state, tasks = SpringRobot(slide=0.035).state(WORKING), [PositionTask(np.zeros(3))]
    guide.slide = 0.035
    assert guide(state, tasks) is None
    assert_names(guide.notice, "closest pose")
    searching = guide.notice
    assert guide(state, tasks) is None
    finder.go.set()
    guide.close(60.0)
    assert guide(state, tasks) is (NO_PATH if isinstance(answer, Exception) else answer)
    assert guide.notice != searching
    if named:
        assert guide.notice.startswith(NEAR_PATH)
        assert_names(guide.notice, *named)
    else:
        assert guide.notice == ""
    for slide in (0.035, 0.02):
        guide.slide = slide
        assert guide(SpringRobot().state(WORKING), tasks) is None
        guide.close(60.0)
    assert slides == [0.035, 0.02]


def test_a_guide_prepares_its_answers_once_where_the_slide_stays():
    finder, slides = Finder(NO_PATH), []
    guide = PlannerThread(lambda slide: slides.append(slide) or finder)
    for now, slide in ((0.0, 0.02), (0.9, 0.02), (1.0, 0.03), (1.9, 0.03)):
        guide.stand(slide, now)
        guide.close(60.0)
        assert slides == []
    for now in (2.1, 2.2, 9.0):
        guide.stand(0.03, now)
        guide.close(60.0)
        assert slides == [0.03]
        assert finder.prepared
    assert guide.notice == ""


def test_a_guide_hands_the_interpreter_over_while_it_looks():
    """Counted: programs that its thread solves while the node lets go of the interpreter and takes it again."""
    done, begun, solved, interval = threading.Event(), threading.Event(), [], sys.getswitchinterval()
    state, task, solver = SpringRobot(slide=0.035).state(WORKING), PositionTask(np.zeros(3)), IkSolver(3)

    class Solving(Finder):
        def prepare(self):
            while not done.is_set():
                solved.append(solver.solve(build_ik(state, [task])))
                begun.set()

    guide = PlannerThread(lambda slide: Solving(NO_PATH))
    sys.setswitchinterval(0.1)
    try:
        guide.stand(0.035, 0.0)
        guide.stand(0.035, 2.0)
        assert begun.wait(60)
        assert sys.getswitchinterval() == HANDOVER
        meanwhile = []
        for _ in range(100):
            before = len(solved)
            time.sleep(1e-4)  # to let go of the interpreter is all that it is for
            meanwhile.append(len(solved) - before)
        # 10 a handover, more where the machine is busy; never fewer than some 200 where the thread keeps it for 0.1 s
        assert min(meanwhile) < 50
    finally:
        done.set()
        guide.close(60.0)
        sys.setswitchinterval(interval)


def test_it_asks_as_soon_as_the_target_stands_still_where_steps_do_not_better_the_pose():
    state, target, asked = SpringRobot(slide=0.035).state(WORKING), np.zeros(6), []
    guidance = PathFollower(lambda state, *_: asked.append(state))
    for k in range(8):  # the target moves
        guidance.look(state, (), target + 1e-3 * k, 3e-3, k * DT, closest=True)
    for k in range(8, 16):  # steps come closer
        guidance.look(state, (), target, 3e-3, k * DT, closest=False)
    assert not asked
    guidance.look(state, (), target, 3e-3, 16 * DT, closest=False, before_snap=True)
    assert asked


@pytest.mark.parametrize(("closest", "waits"), [(True, True), (False, False)])
def test_a_robot_that_could_still_move_waits_for_an_answer_for_a_short_while_only(closest, waits):
    state, target = SpringRobot(slide=0.035).state(WORKING), np.zeros(6)
    guidance = PathFollower(lambda *_: None)
    for now in (0.0, DT):
        guidance.look(state, (), target, 3e-3, now, closest=closest, before_snap=True)

    def command(now):
        return guidance.command(state, WORKING, target, now, dt=DT, reach=0.03, speed=0.06)

    assert command(0.4) == pytest.approx(WORKING)
    assert (command(0.6) is not None) == waits


def test_a_posture_is_gone_to_straight_however_near_a_snap():
    """Else a robot that is led leaves the way where that becomes firmer, and snaps."""
    turn = np.array([0.008, 0.022, -0.029])
    state = replace(
        SpringRobot(slide=0.035).state(WORKING),
        stability_margin=0.05,
        stability_margin_slope=np.array([53.5, 53.5, 38.2]),
    )
    result = IkSolver(3).solve(build_ik(state, [PostureTask(WORKING + turn, weight=1.0)]))
    assert result.command - WORKING == pytest.approx(turn, abs=1e-3 * np.abs(turn).max())
