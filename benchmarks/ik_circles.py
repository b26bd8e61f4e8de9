"""How inverse kinematics goes round circles that leave what can be reached.

    python benchmarks/ik_circles.py [--radii 6 8 10 12] [--slides 0 12 23 35] [--heights -2 0 2] [--moving 10]

From a start pose, the flat piece (slide 0), the working pose (slide 35 mm) or between, the quasi-static model follows
the goals of a horizontal circle about where the effector starts, 12 goals one after the other for as long as it takes,
2.4 s at most, and the start once more. For each circle: the largest speed of the resting effector [m/s], moves that the
Jacobians did not foretell (snaps), goals met to 0.1 mm, the longest time to one of these [s], and how far off others
the effector stays [mm], in their order; nothing tells whether these could be reached, or neared more.

Moving: the circle of that radius from the flat piece in the dynamic
simulator, 2.4 s for each goal: speed of the effector and its distance at the end.
"""

import argparse

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_graph.names import WORKING_POSE
from tripod_ik.model import StaticModel, goes_on, linear_state
from tripod_ik.state import LinearState
from tripod_ik.tracker import Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError

DT, LONGEST = 0.02, 2.4
"""Time between commands of the quasi-static model, longest time for a goal [s]."""

MET, STILL, CALM = 1e-4, 1e-6, 0.5
"""Distance from a goal that is met [m]; turn in a step [rad] and time [s] after which a pose is taken as the end."""


def model_at(slide: float) -> StaticModel:
    """Return the model at its start: angles in proportion to `slide` [m], so that the strips stay stretched."""
    angles = np.array(WORKING_POSE[:3]) * slide / WORKING_POSE[3]
    return StaticModel(load_scene("tripod"), slide, angles)


class Follower:
    """A tracker on a quasi-static model."""

    def __init__(self, model: StaticModel) -> None:
        """Start where the model starts."""
        model.go_home()
        self.model, self.tracker, self.now = model, Tracker(TrackerSettings()), 0.0
        self.speed, self.snaps = 0.0, 0

    def go(self, goal: np.ndarray) -> tuple[LinearState, float]:
        """Go to `goal` [m]; return the state at the end and the time until it was met for good [s]."""
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
        return state, met


def azimuth(angle: float, radius: float, height: float = 0.0) -> np.ndarray:
    """Return the point of a circle at `angle` [rad]."""
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


def circle(model: StaticModel, radius: float, height: float) -> str:
    """Return what one circle gave, as a row."""
    home, follower = model.go_home().equilibrium.copy(), Follower(model)
    times, off = [], []
    for k in range(13):
        goal = home + (azimuth(2 * np.pi * k / 12, radius, height) if k < 12 else 0.0)
        state, met = follower.go(goal)
        if np.isfinite(met):
            times.append(met)
        else:
            off.append(f"{1e3 * np.linalg.norm(state.equilibrium - goal):.2f}")
    longest = max(times, default=0.0)
    return f"{follower.speed:.3f} | {follower.snaps} | {len(times)} of 13 | {longest:.2f} | {', '.join(off) or '-'}"


def moving(radius: float) -> None:
    """Print the circle in the dynamic simulator, goal by goal."""
    simulation = Simulation(load_scene("tripod"))
    home, dt = simulation.state.centres[0].copy(), simulation.scene.dt
    tracker, joints, now = Tracker(TrackerSettings()), simulation.state.joints.copy(), 0.0
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
    parser.add_argument("--moving", type=float, default=10, help="mm; 0 for none")
    chosen = parser.parse_args()
    print(f"machine: 1000 x 1000 matrix product in {1e3 * calibration():.0f} ms")
    print("| slide, height, radius [mm] | speed | snaps | met | longest | others, off by |")
    print("|---|---|---|---|---|---|")
    for slide in chosen.slides:
        model = model_at(slide / 1e3)
        for height in chosen.heights:
            for radius in chosen.radii:
                try:
                    row = circle(model, radius / 1e3, height / 1e3)
                except StepError as error:
                    row = f"{error}" + " |" * 4
                print(f"| {slide:g}, {height:g}, {radius:g} | {row} |", flush=True)
    if chosen.moving:
        moving(chosen.moving / 1e3)


if __name__ == "__main__":
    main()
