"""The Tripod's load cases against converged references.

References: neo-Hooke, quadratic hexahedra, cross-checked against an independent code (docs/accuracy.md names them).
"""

import numpy as np
import pytest

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_study.run import run

STATIC = ("inertia=off", "damping=off")
QUARTER = -np.pi / 4
L4 = (-1.4965, -1.4965, -1.4965, 0.035)


def test_l1_sag_under_gravity() -> None:
    result = run(SHARP, overrides=["motion=off"])
    assert result["effector"]["position"][2] == pytest.approx(
        -2.097e-3, rel=0.10
    )  # one layer is stiff in plain bending


def test_l2_all_servos_at_45_degrees() -> None:
    angles = f"{QUARTER},{QUARTER},{QUARTER}"
    result = run(SHARP, servo=f"0:0,0,0; 1:{angles}")
    assert result["energies"]["strain"] == pytest.approx(0.6959, rel=0.03)
    np.testing.assert_allclose(result["torques"], -0.505, rtol=0.03)


def test_l3_one_servo_at_45_degrees() -> None:
    result = run(SHARP, servo=f"0:0,0,0; 1:{QUARTER},0,0")
    x, y, _ = result["effector"]["position"]
    assert np.hypot(x, y) == pytest.approx(11.858e-3, rel=0.02)
    assert abs(y) < 1e-9  # symmetric about strip 0


def test_l4_working_pose() -> None:
    result = run(SHARP, servo="0:0,0,0; 1:-1.4965,-1.4965,-1.4965", slide="0.035")
    assert result["effector"]["position"][2] == pytest.approx(-8.25e-3, rel=0.03)
    np.testing.assert_allclose(result["torques"], -0.140, rtol=0.05)


def path(increments: int) -> tuple[np.ndarray, Simulation]:
    """Effector heights along the way to the working pose, and the simulation there."""
    simulation = Simulation(load_scene(SHARP, STATIC))
    heights = [simulation.state.centres[0, 2]]
    for k in range(1, increments + 1):
        simulation.step(np.array(L4) * k / increments)
        heights.append(simulation.state.centres[0, 2])
    return np.array(heights), simulation


def test_l4_path_never_jumps_a_branch() -> None:
    coarse, simulation = path(20)
    fine, _ = path(160)
    # on one smooth branch the height is a smooth function of the path: second differences fall with the square of
    # the increment (64 from 20 to 160); a jump anywhere would leave them at the size of the jump
    bend = [np.abs(np.diff(h, 2)).max() for h in (coarse, fine)]
    assert bend[1] < bend[0] / 30
    np.testing.assert_allclose(
        fine[::8], coarse, atol=2e-7
    )  # and the same height is reached by either increment
    for k in range(19, -1, -1):  # and back along the same branch
        simulation.step(np.array(L4) * k / 20)
        assert simulation.state.centres[0, 2] == pytest.approx(coarse[k], abs=2e-7)


def test_dynamic_run_comes_to_rest_in_the_static_pose() -> None:
    _, static = path(20)
    result = run(SHARP, servo="0:0,0,0; 1:-1.4965,-1.4965,-1.4965", slide="0.035", duration=3.0)
    np.testing.assert_allclose(result["effector"]["position"], static.state.centres[0], atol=2e-6)
    assert result["energies"]["kinetic"] < 1e-8


def test_material_laws_differ_where_strains_are_large() -> None:
    """L2 holds mean strains near 40 %: facts on the corotational law say two thirds more torque there."""
    angles = f"0:0,0,0; 1:{QUARTER},{QUARTER},{QUARTER}"
    hooke = run(SHARP, servo=angles)["torques"][0]
    corotational = run(SHARP, servo=angles, overrides=["material.law=corotational"])["torques"][0]
    assert corotational / hooke == pytest.approx(1.67, abs=0.1)
