"""The scene `throw`: a ball that lies on the Tripod, is thrown by its servos under TR-BDF2, and flies."""

import numpy as np
import pytest

from tripod_sim import Simulation, load_scene
from tripod_sim.scene.script import script_of

G, MASS = 9.81, 0.002  # [m/s²], [kg]
RADIUS, GAP, HALF = (
    0.008,
    0.0005,
    0.0025,
)  # of the ball, contact distance, half the thickness of the silicone [m]
UP = 0.44
"""From here on the servos stand [s]."""


def thrown(end: float, *overrides: str) -> tuple[np.ndarray, ...]:
    """Return times, places of the ball and of the disc's centre, and energies (all, of the ball), row by row."""
    simulation = Simulation(load_scene("throw", overrides))
    scene, rows = simulation.scene, []
    script = script_of(scene)
    for k in range(round(end / scene.dt)):
        simulation.step(script.joints(simulation.command, scene.dt * (k + 1)))
        energies, state = simulation.energies(), simulation.state
        place = simulation.rigid[0].position
        total = energies.kinetic + energies.strain + energies.gravity
        rows.append((state.time, *place, simulation.effector.position[2], total))
    times, x, y, z, disc, total = np.array(rows).T
    return times, np.column_stack([x, y, z]), disc, total


def test_it_is_caught_thrown_and_flies_on_a_parabola() -> None:
    times, ball, disc, total = thrown(0.53)
    dt = times[1] - times[0]
    lying = (times > 0.34) & (times < 0.395)
    apart = ball[:, 2] - disc
    top = float(np.median(apart[lying]))
    assert np.ptp(apart[lying]) < 1e-5, "it lies on the silicone"
    assert HALF + 0.9 * RADIUS < top < HALF + RADIUS + GAP, "on a facet of the ball, which is a polyhedron"
    free = np.flatnonzero((times > UP) & (apart > top + 0.003))
    assert len(free) > 25
    assert np.array_equal(free, np.arange(free[0], free[-1] + 1)), "one flight"
    inner = free[1:-1]
    falls = np.diff(ball, n=2, axis=0)[inner - 1] / dt**2
    assert falls == pytest.approx(np.tile([0.0, 0.0, -G], (len(falls), 1)), abs=1e-5), (
        "TR-BDF2 is exact for it"
    )
    speed = (ball[inner + 1, 2] - ball[inner - 1, 2]) / (2 * dt)
    energy = MASS * (0.5 * speed**2 + G * ball[inner, 2])
    assert np.ptp(energy) < 1e-7 * energy.mean()
    assert ball[:, 2].max() > 0.024, "twice as high as it lay"
    assert np.abs(ball[free, :2]).max() < 1e-5, "straight up"
    after = total[times > UP + 0.5 * dt]
    assert np.diff(after).max() < 1e-3 * np.ptp(total), "where no servo moves nothing is gained"
    assert apart.min() > top - GAP, "nothing passes"


def test_how_high_it_flies_hardly_depends_on_the_step() -> None:
    coarse, fine = (thrown(0.48, f"dt={dt}")[1][:, 2].max() for dt in (0.001, 0.0005))
    assert fine == pytest.approx(coarse, rel=0.05)
