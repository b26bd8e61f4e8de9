"""How inverse kinematics goes round circles that leave what can be reached.

    python benchmarks/ik_circles.py [--radii 6 8 10 12] [--slides 0 12 23 35] [--heights -2 0 2] [--copies 5]
                                    [--moving 10] [--no-search]

From a start pose, the flat piece (slide 0), the working pose (slide 35 mm) or between, the quasi-static model follows
the goals of a horizontal circle about where the effector starts, 12 goals one after the other for as long as it takes,
2.4 s at most, and the start once more; the tracker asks a pathfinder for the way, one for each slide. For each circle:

- speed: the largest of the resting effector [m/s]; snaps: moves that the Jacobians did not foretell;
- met: goals met to 0.1 mm; longest: time to one of these [s], the pathfinder's CPU time with it;
- off: how far off others the effector stays [mm], in their order; search: the least distance [mm] that an independent
  search finds for these: a flood over all angles from the start pose, SciPy's SLSQP from the nearest of it
  (`tests/ik/search.py`), within the same angles, torques and firmness. Worse: the largest difference.

Copies: circles at random, begun anywhere, each rotated by thirds of a turn and mirrored: six times the same goals. How
far the answers are apart, mirrored back.

Moving: the circle of that radius from the flat piece in the dynamic simulator, 2.4 s for each goal: speed of the
effector and its distance at the end.
"""

import argparse
import sys
import time
from pathlib import Path

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.ik.search import Flood, Limits
from tripod_graph.names import WORKING_POSE
from tripod_ik.model import StaticModel, goes_on, linear_state
from tripod_ik.pathfinder import Pathfinder, Way
from tripod_ik.snap import SOFTEST
from tripod_ik.state import LinearState
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError

DT, LONGEST = 0.02, 2.4
"""Time between commands of the quasi-static model, longest time for a goal [s]."""

MET, STILL, CALM = 1e-4, 1e-6, 0.5
"""Distance from a goal that is met [m]; turn in a step [rad] and time [s] after which a pose is taken as the end."""

SETTINGS = TrackerSettings()
LIMITS = Limits(torque=SETTINGS.torque_max, firmness=SOFTEST)


def start_angles(slide: float) -> np.ndarray:
    """Return the angles [rad] at the start: in proportion to `slide` [m], so that the strips stay stretched."""
    return np.array(WORKING_POSE[:3]) * slide / WORKING_POSE[3]


def model_at(slide: float) -> StaticModel:
    """Return the model at its start."""
    return StaticModel(load_scene("tripod"), slide, start_angles(slide))


class Timed:
    """A pathfinder, and the CPU time of its answers [s]."""

    def __init__(self, slide: float) -> None:
        """`slide`: [m]."""
        self.finder = Pathfinder.of(load_scene("tripod"), slide, *Tracker(SETTINGS).reach)
        self.times: list[float] = []

    def __call__(self, state: LinearState, tasks: object) -> Way | None:
        """Return the way, as a tracker asks for it."""
        begin = time.thread_time()
        way = self.finder.way(state, tasks)  # type: ignore[arg-type]
        self.times.append(time.thread_time() - begin)
        return way


class Follower:
    """A tracker on a quasi-static model."""

    def __init__(self, model: StaticModel, guide: Timed) -> None:
        """Start where the model starts."""
        model.go_home()
        self.model, self.guide, self.now = model, guide, 0.0
        self.tracker = Tracker(SETTINGS, guide=guide)
        self.speed, self.snaps = 0.0, 0

    def go(self, goal: np.ndarray) -> tuple[LinearState, float]:
        """Go to `goal` [m]; return the state at the end and the time until it was met for good [s], thinking too."""
        asked = len(self.guide.times)
        self.tracker.aim(goal, None, self.now)
        state, begin, met, quiet = self.model.state(), self.now, np.inf, 0
        while self.now - begin < LONGEST:
            step = self.tracker.update(state, self.now)
            before, state = state, self.model.move(step.result.command)
            self.now += DT
            self.speed = max(self.speed, float(np.linalg.norm(state.equilibrium - before.equilibrium)) / DT)
            self.snaps += not goes_on(before, state)
            near = np.linalg.norm(state.equilibrium - goal) <= MET
            met = min(met, self.now - begin) if near else np.inf
            still = np.abs(state.angles - before.angles).max() < STILL
            quiet = quiet + 1 if still and (near or step.activity is Activity.CLOSEST) else 0
            if quiet * DT > CALM or (near and quiet):
                break
        return state, met + sum(self.guide.times[asked:])


def azimuth(angle: float, radius: float, height: float = 0.0) -> np.ndarray:
    """Return the point of a circle at `angle` [rad]."""
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


def circle(model: StaticModel, guide: Timed, radius: float, height: float, flood: Flood | None) -> str:
    """Return what one circle gave, as a row."""
    home, follower = model.go_home().equilibrium.copy(), Follower(model, guide)
    times, off, least = [], [], []
    for k in range(13):
        goal = home + (azimuth(2 * np.pi * k / 12, radius, height) if k < 12 else 0.0)
        state, met = follower.go(goal)
        if np.isfinite(met):
            times.append(met)
        else:
            off.append(float(np.linalg.norm(state.equilibrium - goal)))
            least.append(flood.closest(goal, LIMITS)[0] if flood else np.nan)
    longest = max(times, default=0.0)
    lists = [", ".join(f"{1e3 * d:.3f}" for d in found) or "-" for found in (off, least)]
    worse = f"{1e3 * max(np.subtract(off, least)):.3f}" if off else "-"
    cells = (f"{follower.speed:.3f}", follower.snaps, f"{len(times)} of 13", f"{longest:.2f}", *lists, worse)
    return " | ".join(str(cell) for cell in cells)


def image(points: np.ndarray, turn: int, *, mirrored: bool) -> np.ndarray:
    """Return points, shape (k, 3), rotated by a third of a turn `turn` times, mirrored at the plane y = 0 before."""
    points = points * [1, -1 if mirrored else 1, 1]
    c, s = np.cos(2 * np.pi * turn / 3), np.sin(2 * np.pi * turn / 3)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def copies(count: int) -> None:
    """Print how far answers to rotated and mirrored goals are apart."""
    rng = np.random.default_rng(16)
    print("| circle: slide, height, radius, begun at | copies | answers apart [mm] |\n|---|---|---|")
    for number in range(count):
        slide, radius = (0.0, 0.01) if number == 0 else (0.035 * rng.uniform(), rng.uniform(0.006, 0.012))
        height, phase = rng.uniform(-0.002, 0.002), rng.uniform(0, 2 * np.pi)
        model, guide = model_at(slide), Timed(slide)
        goals = np.array([azimuth(phase + 2 * np.pi * k / 6, radius, height) for k in range(6)])
        answers = []
        for mirrored in (False, True):
            for turn in range(3):
                follower, home = Follower(model, guide), model.go_home().equilibrium
                there = image(goals, turn, mirrored=mirrored)
                ends = [follower.go(home + goal)[0].equilibrium - home for goal in there]
                back = image(np.array(ends), -turn, mirrored=False)
                answers.append(image(back, 0, mirrored=mirrored))
        apart = np.linalg.norm(np.ptp(answers, axis=0), axis=1).max()
        where = (
            f"{1e3 * slide:.1f}, {1e3 * height:.2f}, {1e3 * radius:.1f} mm, {np.degrees(phase):.0f} degrees"
        )
        print(f"| {where} | 6 | {1e3 * apart:.4f} |", flush=True)


def moving(radius: float) -> None:
    """Print the circle in the dynamic simulator, goal by goal."""
    simulation, guide = Simulation(load_scene("tripod")), Timed(0.0)
    home, dt = simulation.state.centres[0].copy(), simulation.scene.dt
    tracker, joints, now = Tracker(SETTINGS, guide=guide), simulation.state.joints.copy(), 0.0
    print("| goal | largest speed [m/s] | off at the end [mm] |\n|---|---|---|")
    for k in range(13):
        goal = home + (azimuth(2 * np.pi * k / 12, radius) if k < 12 else 0.0)
        tracker.aim(goal, None, now)
        speed = 0.0
        for _ in range(round(LONGEST / dt)):
            before = simulation.state.centres[0].copy()
            joints[:3] = tracker.update(linear_state(simulation.compliance()), now).result.command
            simulation.step(joints)
            now += dt
            speed = max(speed, float(np.linalg.norm(simulation.state.centres[0] - before)) / dt)
        off = 1e3 * float(np.linalg.norm(simulation.state.centres[0] - goal))
        print(f"| {k} | {speed:.3f} | {off:.3f} |", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--radii", nargs="*", type=float, default=[6, 8, 10, 12], help="mm")
    parser.add_argument("--slides", nargs="*", type=float, default=[0, 12, 23, 35], help="mm")
    parser.add_argument("--heights", nargs="*", type=float, default=[-2, 0, 2], help="mm, from the start")
    parser.add_argument("--copies", type=int, default=5, help="circles, of which there are six copies each")
    parser.add_argument("--moving", type=float, default=10, help="mm; 0 for none")
    parser.add_argument(
        "--no-search", action="store_true", help="without the independent search, minutes a slide"
    )
    chosen = parser.parse_args()
    print(f"machine: 1000 x 1000 matrix product in {1e3 * calibration():.0f} ms")
    for slide in chosen.slides:
        model, guide, flood = model_at(slide / 1e3), Timed(slide / 1e3), None
        print("\n| slide, height, radius [mm] | speed | snaps | met | longest | off | search | worse |")
        print("|---|---|---|---|---|---|---|---|")
        if not chosen.no_search:
            flood = Flood(model_at(slide / 1e3), SETTINGS.angle_min, SETTINGS.angle_max, LIMITS)
        for height in chosen.heights:
            for radius in chosen.radii:
                try:
                    row = circle(model, guide, radius / 1e3, height / 1e3, flood)
                except StepError as error:
                    row = f"{error}" + " |" * 6
                print(f"| {slide:g}, {height:g}, {radius:g} | {row} |", flush=True)
        known = f"{len(flood.poses)} poses of the search, " if flood else ""
        slowest = ", ".join(f"{t:.1f}" for t in sorted(guide.times)[-3:]) or "none"
        print(f"{known}{len(guide.times)} ways asked for, the slowest answers after {slowest} s of CPU time")
    if chosen.copies:
        copies(chosen.copies)
    if chosen.moving:
        moving(chosen.moving / 1e3)


if __name__ == "__main__":
    main()
