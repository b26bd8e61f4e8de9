"""The closest pose that the body comes to without a snap: found, gone to, and left again, from the flat piece.

Its servos at 0 and not slid in, goals 10 mm off towards a servo are out of reach; coming from beside one the tracker by
itself ends at a fold, and stays there for goals that are in reach.
"""

import numpy as np
import pytest

from tests.ik.search import Flood, Limits
from tests.scenes import SHARP
from tripod_ik.joint_path import NO_PATH
from tripod_ik.limits import AngleLimit
from tripod_ik.model import StaticModel, goes_on
from tripod_ik.planner import Planner
from tripod_ik.roadmap import Roadmap
from tripod_ik.snap_through import LEAST_MARGIN
from tripod_ik.tasks import PositionTask
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import load_scene

DT = 0.02  # [s]
SETTINGS = TrackerSettings()


def at(degrees, radius=0.01):
    return radius * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])


@pytest.fixture(scope="module")
def finder():
    return Planner(Roadmap.of(load_scene(SHARP), 0.0), *Tracker(SETTINGS).reach)


@pytest.fixture(scope="module")
def between():
    return Planner(Roadmap.of(load_scene(SHARP), 0.012), *Tracker(SETTINGS).reach)


@pytest.fixture(scope="module")
def slid_in():
    """The roadmap of the working slide."""
    return Roadmap.of(load_scene(SHARP), 0.035)


def follow(flat, finder, goals, seconds=1.0):
    """Go to one goal after the other, in 1 s each or as said; return the states and the tracker's last steps."""
    home, tracker, now, ends = (
        flat.state().equilibrium,
        Tracker(SETTINGS, guide=finder.way, smooth=0.12),
        0.0,
        [],
    )
    for goal in goals:
        tracker.aim(home + goal, None, now)
        for _ in range(round(seconds / DT)):
            before, here = flat.state(), flat.save()
            step = tracker.update(before, now)
            after = flat.move(step.result.command)
            if not goes_on(before, after):
                flat.restore(here)
                assert flat.follow(after.angles).equilibrium == pytest.approx(
                    after.equilibrium, abs=1e-6
                )  # no snap
            assert np.linalg.norm(after.equilibrium - before.equilibrium) < 0.1 * DT
            now += DT
        ends.append((after, step))
    return home, ends


@pytest.mark.slow
def test_round_the_edge_of_reach_it_ends_closest_and_comes_back_mirrored_for_mirrored_goals(flat, finder):
    found = {}
    for name, sign in (("left", 1), ("right", -1)):
        flat.go_home()
        goals = [at(sign * degrees) for degrees in (90, 120, 150)]
        home, ends = follow(flat, finder, goals)
        (met, _), (closest, step), (again, _) = ends
        assert np.linalg.norm(met.equilibrium - home - goals[0]) < 1e-5
        assert np.linalg.norm(again.equilibrium - home - goals[2]) < 1e-5
        assert step.activity is Activity.CLOSEST
        assert "snap" in step.result.active_limits
        found[name] = closest.equilibrium - home
    flat.go_home()
    home, ((straight, _),) = follow(flat, finder, [at(0)])
    found["straight"] = straight.equilibrium - home
    distances = [
        np.linalg.norm(found[n] - at(d)) for n, d in (("left", 120), ("right", -120), ("straight", 0))
    ]
    assert np.ptp(distances) < 1e-6
    assert max(distances) < 0.97e-3
    assert found["left"] * [1, -1, 1] == pytest.approx(found["right"], abs=2e-5)
    turned = np.array([[-0.5, -np.sqrt(0.75), 0], [np.sqrt(0.75), -0.5, 0], [0, 0, 1]]) @ found["straight"]
    assert found["left"] == pytest.approx(turned, abs=2e-5)


@pytest.mark.slow
def test_beyond_a_gap_between_sheets_the_closest_pose_is_found_whatever_was_asked_before(between):
    """Slid in by 12 mm the body rests above or below; the sheets of both hang together only near home."""
    home, start = between.model.go_home().equilibrium, between.model.home

    def asked(goal):
        return between.closest([PositionTask(home + goal)], start).solution.residual

    def three(degrees, radius):
        return [asked(at(degrees + turn, radius)) for turn in (0, 120, 240)]

    low, high = np.array([0.0, 0.0, -0.002]), np.array([0.0, 0.0, 0.002])
    first = asked(at(0))
    assert asked(at(0) + low) < 1e-6
    assert asked(at(0) + high) < 1e-6
    assert asked(at(0)) == pytest.approx(first, abs=1e-9)
    for radius, expected in ((0.008, (0.514, 0.281, 0.227)), (0.01, (0.398, 0.910, 0.989))):
        assert three(0, radius) == pytest.approx([1e-3 * expected[0]] * 3, abs=2e-6)
        for turn, mirrored in ((0, 30), (120, -30), (240, 30)):
            assert asked(at(turn + mirrored, radius)) == pytest.approx(1e-3 * expected[1], abs=2e-6)
        assert asked(at(60, radius)) == pytest.approx(1e-3 * expected[2], abs=2e-6)
    assert asked(at(0)) == pytest.approx(first, abs=1e-9)


@pytest.mark.slow
def test_where_a_strip_hangs_slack_it_does_not_snap_by_itself(slid_in):
    """Slid in by 35 mm, 90 degrees from a servo: the straight way there snaps a strip while the effector is firm, and
    so does one between two neighbours of the grid.
    """
    working = StaticModel(load_scene(SHARP), 0.035)
    finder = Planner(slid_in, *Tracker(SETTINGS).reach)
    goals = [at(degrees, 0.012) + np.array([0.0, 0.0, 0.002]) for degrees in (0, 30, 60, 90)]
    home, ends = follow(working, finder, goals, seconds=1.4)
    for goal, (state, _) in zip(goals, ends, strict=True):
        assert np.linalg.norm(state.equilibrium - home - goal) < 1e-6


def test_a_goal_on_another_sheet_is_met(between):
    """30 degrees beside a servo and 2 mm lower."""
    home = between.model.go_home().equilibrium
    found = between.closest([PositionTask(home + at(30, 0.006) - [0.0, 0.0, 0.002])], between.model.home)
    assert found.solution.residual < 1e-6


def test_goals_on_another_sheet_are_met_soon(between):
    """2 mm higher on a circle of 10 mm; thinking, which takes 0.1 to 0.4 s more, is not counted."""
    model = StaticModel(load_scene(SHARP), 0.012, between.model.home)
    goals = [at(degrees) + np.array([0.0, 0.0, 0.002]) for degrees in (0, 30, 60, 90)]
    home, ends = follow(model, between, goals, seconds=0.64)
    for k in (0, 1, 3):
        assert ends[k][0].equilibrium == pytest.approx(home + goals[k], abs=1e-4), k
    assert ends[2][1].activity is Activity.CLOSEST


@pytest.mark.slow
def test_the_closest_pose_is_that_of_a_search_everywhere(finder):
    """More of them are in benchmarks/ik_circles.py."""
    model = Flood.model(load_scene(SHARP), 0.0, np.zeros(3))
    home, limits = (
        model.state().equilibrium.copy(),
        Limits(torque=SETTINGS.torque_max, stability_margin=LEAST_MARGIN),
    )
    flood = Flood(model, -2.1, 0.6, limits, spacing=0.2, within=0.011)
    assert len(flood.poses) > 50  # a flood that does not leave the flat piece finds nothing closer
    for goal in (at(0), at(35, 0.012), at(-120, 0.008)):
        solution = finder.closest([PositionTask(home + goal)], np.zeros(3)).solution
        least = flood.closest(home + goal, limits, starts=2)[0]
        assert solution.residual > 1e-4
        assert solution.residual < least + 5e-5


def test_a_robot_that_does_not_rest_as_the_model_does_gets_no_way(flat, finder):
    other = StaticModel(load_scene(SHARP, ["material.young=4e5"]), 0.0, np.zeros(3)).state()
    assert finder.way(other, [PositionTask(np.array([0.01, 0.0, 0.0]))]) is NO_PATH


def test_ways_of_turned_and_mirrored_questions_are_turned_and_mirrored(flat, finder):
    home = flat.go_home()
    state = flat.follow(np.array([0.03, -0.4, 0.3]))
    task, ways = PositionTask(home.equilibrium + at(120)), []
    images = flat.symmetries()
    assert len(images) == 6
    for image in images:
        way = finder.way(image.state(state), [image.task(task)])
        assert len(way.stops) > 1
        ways.append((np.array([image.back(stop) for stop in way.stops]), way.residual))
    for stops, residual in ways:
        assert stops == pytest.approx(ways[0][0], abs=1e-9)
        assert residual == pytest.approx(ways[0][1], abs=1e-12)
    names = ["servo_0 torque", "snap", "servo_2 angle max"]
    assert images[1].names(names, state.joint_names) == ("servo_2 torque", "snap", "servo_1 angle max")


@pytest.mark.slow
def test_a_way_is_known_where_all_poses_are(slid_in):
    """Of few angles all poses are soon found: then the present one is still among them."""
    finder = Planner(slid_in, AngleLimit(-1.8, -1.2))
    home = finder.model.go_home().equilibrium
    far = [PositionTask(home + np.array([0.05, 0.0, 0.0]))]
    finder.closest(far, finder.model.home)
    state = finder.model.move(np.array([-1.45, -1.55, -1.35]))
    way = finder.way(state, far)
    assert way is not NO_PATH
    assert way.stops[-1] == pytest.approx([-1.8, -1.2, -1.2], abs=1e-4)


def test_a_way_does_not_lead_over_a_snap_that_its_ends_say_nothing_of():
    """From the sheet above to that below, past where the body would snap: what the Jacobians at both ends say fits."""
    finder = Planner(Roadmap.of(load_scene(SHARP), 0.023), *Tracker(SETTINGS).reach)
    model = finder.model
    goal = [PositionTask(model.go_home().equilibrium + np.array([0.012, 0.0, 0.002]))]
    state = model.follow(np.array([-1.242, -0.59, -0.59]))
    way = finder.way(state, goal)
    assert way.residual < 1.6e-3
    model.go_home()
    here = model.follow(state.angles)
    start = state.angles
    for stop in way.stops:
        for angles in np.linspace(start, stop, 26)[1:]:
            before, here = here, model.move(angles)
            assert np.linalg.norm(here.equilibrium - before.equilibrium) < 5e-4
        start = stop


@pytest.mark.slow
def test_a_way_makes_no_long_detour(between, monkeypatch):
    """12 mm off, from 2 mm higher to 2 mm lower: the sheets hang together near home, the far one is hardly closer."""
    model = between.model
    home = model.go_home().equilibrium
    above, below = (home + at(0, 0.012) + [0.0, 0.0, z] for z in (0.002, -0.002))
    state = between.closest([PositionTask(above)], model.home).solution.state
    here = model.save()

    def farthest():
        way = between.way(state, [PositionTask(below)])
        model.restore(here)
        ends = zip([state.angles, *way.stops[:-1]], way.stops, strict=True)
        passed = [angles for begin, end in ends for angles in np.linspace(begin, end, 9)[1:]]
        off = [np.linalg.norm(model.follow(angles).equilibrium - below) for angles in passed]
        return max(off), way.residual

    begin = np.linalg.norm(state.equilibrium - below)
    free, closest = farthest()
    assert begin + 4e-3 < free < begin + 8e-3
    assert closest < 1e-3
    monkeypatch.setattr("tripod_ik.planner.DETOUR", 4e-3)
    off, residual = farthest()
    assert off < begin + 4e-3
    assert closest < residual < closest + 2e-3
