"""From one start pose, the one-shot command and the node's rule in the dynamic simulator give one answer."""

from functools import cache

import numpy as np
import pytest

from tests.scenes import SHARP
from tests.tiers import sampled
from tripod_ik.model import home_angles, linear_state
from tripod_ik.planner import Planner
from tripod_ik.roadmap import Roadmap
from tripod_ik.solve_once import solve_once
from tripod_ik.tracker import SMOOTH, Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene

SETTINGS = TrackerSettings()
SLIDES = (0.0, 0.012, 0.023, 0.035)
DT, REST, LONGEST = 0.02, 1.0, 12.0
"""Time between commands, that the body rests before the first, and of the longest motion [s]."""

CALM, STILL = 0.6, 1e-6
"""Time [s] for which commands are still, and their turn [rad], at the end of a motion."""


@cache
def roadmap(slide: float) -> Roadmap:
    return Roadmap.of(load_scene(SHARP), slide)


def question(seed: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Return slide [m], start angles [rad] and target [m]; about one of three is out of reach."""
    rng, slide = np.random.default_rng([53, seed]), SLIDES[seed % len(SLIDES)]
    start = np.clip(home_angles(3, slide) + rng.uniform(-0.3, 0.3, 3), SETTINGS.angle_min, SETTINGS.angle_max)
    turn, radius, height = rng.uniform(0, 2 * np.pi), 0.014 * np.sqrt(rng.uniform()), rng.uniform(-4e-3, 4e-3)
    home = roadmap(slide).poses[0].state.equilibrium
    return slide, start, home + np.array([radius * np.cos(turn), radius * np.sin(turn), height])


def moved(slide: float, start: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """Return where the node's rule brings the servos of the simulated robot [rad], and what is missing at rest [m]."""
    angles = ", ".join(f"{a:.9f}" for a in start)
    simulation = Simulation(load_scene(SHARP, [f"servos.angles=[{angles}]", f"servos.slide={slide}"]))
    finder = Planner(roadmap(slide), *Tracker(SETTINGS).reach)
    tracker = Tracker(SETTINGS, guide=finder.way, smooth=SMOOTH)
    joints, every, calm = simulation.state.joints.copy(), round(DT / simulation.scene.dt), 0
    for _ in range(round(REST / simulation.scene.dt)):
        simulation.step(joints)
    tracker.aim(target, None, 0.0)
    last = joints[:3].copy()
    for k in range(round(LONGEST / DT)):
        told = tracker.update(linear_state(simulation.compliance()), k * DT)
        assert told.result.ok
        command = told.result.command
        ended = told.activity is Activity.CLOSEST or told.result.residual <= SETTINGS.tolerance
        ended = ended and told.activity is not Activity.SEARCHING
        calm = calm + 1 if np.abs(command - last).max() < STILL and ended else 0
        if calm * DT > CALM:
            break
        for part in range(every):
            joints[:3] += (command - joints[:3]) / (every - part)
            simulation.step(joints)
        last = command
    state = linear_state(simulation.compliance())
    return state.angles, float(np.linalg.norm(state.equilibrium - target))


@pytest.mark.parametrize("seed", sampled(range(50), 0, 1, 3))
def test_command_and_node_have_one_answer(seed: int) -> None:
    slide, start, target = question(seed)
    scene = load_scene(SHARP)
    once = solve_once(scene, target.tolist(), slide=slide, start=start.tolist())
    angles, missing = moved(slide, start, target)
    assert once["reached"] == (missing <= SETTINGS.tolerance), (once["error"], missing)
    assert once["error"] == pytest.approx(missing, abs=5e-5)
    assert angles == pytest.approx(once["angles"], abs=0.02)
    assert bool(once["reason"]) != once["reached"]
