"""How near to a snap: stability margin and its slope against finite moves, and the state of rest of a body that
swings."""

import numpy as np
import pytest
from scipy.linalg import eigh

from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene

STATIC = ["inertia=off", "damping=off", "solver.tolerance=1e-9"]
SNAPPING = np.array([-0.28, 0.14, 0.14, 0.0])
"""Joints beyond those at which the flat piece snaps up, on the straight way."""


@pytest.fixture(scope="module")
def flat() -> Simulation:
    return Simulation(load_scene(SHARP, STATIC))


@pytest.mark.parametrize("angles", [[-0.24, 0.12, 0.12], [-0.3, 0.06, 0.21], [-0.2, 0.0, 0.2]])
def test_the_slope_of_the_stability_margin_is_that_of_finite_moves(
    flat: Simulation, angles: list[float]
) -> None:
    flat.reset()
    end, h = np.array([*angles, 0.0]), 5e-4
    for part in np.linspace(0.1, 1.0, 10):
        flat.step(part * end)
    here, soft = flat.save(), flat.compliance().stability_margin
    assert soft is not None
    assert 0.06 < soft.value < 0.3
    found = np.empty(3)
    for servo in range(3):
        ends = []
        for sign in (1, -1):
            flat.restore(here)
            turned = end.copy()
            turned[servo] += sign * h
            flat.step(turned)
            other = flat.compliance().stability_margin
            assert other is not None
            ends.append(other.value)
        found[servo] = (ends[0] - ends[1]) / (2 * h)
    # h² times third derivatives, which grow as stability margin falls: 1e-4 at most of these poses
    np.testing.assert_allclose(soft.slope, found, rtol=5e-3, atol=1e-3 * np.abs(found).max())


def test_the_stability_margin_is_the_least_stiffness_of_all_moves(flat: Simulation) -> None:
    flat.reset()
    system, found = flat._static.system, []
    first = 3 * system.reduction.free_count
    nodes = len(system.groups.rigid[0])
    sizes = np.ones(system.unknowns)
    sizes[first : first + 3], sizes[first + 3 :] = nodes, nodes * system.radius(0) ** 2
    for angles in (np.zeros(3), [-0.24, 0.12, 0.12], [-0.27, 0.13, 0.13]):
        for part in np.linspace(0.0, 1.0, 10):
            flat.step(part * np.append(angles, 0.0))
        soft = flat.compliance().stability_margin
        assert soft is not None
        upper = system.reduction.pattern.toarray()
        tangent = upper + np.triu(upper, 1).T
        found.append(
            (
                soft.value,
                eigh(tangent, np.diag(sizes), eigvals_only=True, subset_by_index=[0, 0])[0],
            )
        )
    ratios = np.array([stability_margin / least for stability_margin, least in found])
    np.testing.assert_allclose(ratios, ratios[-1], rtol=1e-3)


def test_the_stability_margin_goes_to_zero_at_the_snap_and_its_square_in_proportion_to_the_angles(
    flat: Simulation,
) -> None:
    flat.reset()
    squares, heights = [], []
    for part in np.linspace(0.05, 1.0, 20):
        flat.step(part * SNAPPING)
        soft = flat.compliance().stability_margin
        assert soft is not None
        squares.append(soft.value**2)
        heights.append(flat.state.centres[0][2])
    jump = int(np.argmax(np.diff(heights)))
    assert np.diff(heights)[jump] > 2e-3  # it did snap
    before = np.diff(squares[jump - 3 : jump + 1])
    assert (before < 0).all()
    left = squares[jump] / -before[-1]  # steps of the way left, if the last one goes on
    assert 0 < left < 1.2


def test_asking_how_soft_a_body_at_rest_is_changes_no_reaction() -> None:
    watched = [
        'set=[{name="middle", radius=0.004, axis=[0,0,1], centre=[0.03,0,0]}]',
        'marker=[{set="middle"}]',
    ]
    resting = Simulation(load_scene(SHARP, [*STATIC, *watched]))
    resting.step(0.8 * SNAPPING)
    force, moment = resting.reactions(0)
    soft = resting.compliance().stability_margin
    assert soft is not None
    assert soft.slope.any()  # it was evaluated elsewhere for that
    assert np.array_equal(resting.reactions(0)[0], force)
    assert np.array_equal(resting.reactions(0)[1], moment)


def test_a_swinging_body_has_the_compliance_of_its_rest() -> None:
    moving = Simulation(load_scene(SHARP))
    end = np.array([-0.2, 0.1, 0.1, 0.0])
    offsets = []
    for k in range(60):
        moving.step(end * min(1.0, (k + 1) / 12))
        if k >= 4:
            c = moving.compliance()
            offsets.append(float(np.linalg.norm(c.equilibrium_offset[:3])))
    resting = Simulation(load_scene(SHARP, STATIC))
    for part in np.linspace(0.1, 1.0, 10):
        resting.step(part * end)
    exact = resting.compliance()
    assert max(offsets[12:20]) > 2e-5  # it swings
    np.testing.assert_allclose(c.position + c.equilibrium_offset[:3], exact.position, atol=1e-8)
    np.testing.assert_allclose(c.w, exact.w, rtol=1e-4, atol=1e-6 * np.abs(exact.w).max())
    assert c.stability_margin is not None
    assert exact.stability_margin is not None
    assert c.stability_margin.value == pytest.approx(exact.stability_margin.value, rel=1e-4)
