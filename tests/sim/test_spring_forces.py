"""Springs: energy, force and tangent agree; momentum is kept; compressed, slack and of no length they stay sane."""

import numpy as np
import pytest

from tests.checks import assert_derivative, assert_gradient, assert_symmetric, random_rotation
from tests.messages import raises_naming
from tests.sim.springs import add_whole_gradient, force_of, hessian
from tripod_sim.errors import SceneError
from tripod_sim.forces.spring_kernels import add_forces, add_gradient, add_products, links_of, tangents
from tripod_sim.springs.body import SpringBody


def random_body(rng: np.random.Generator, *, slack: bool = False, fixed: tuple[int, ...] = ()) -> SpringBody:
    """Ten nodes in a ball, twenty springs of which about half are compressed."""
    nodes = rng.standard_normal((10, 3))
    pairs = np.array([(i, j) for i in range(10) for j in range(i)])
    ends = pairs[rng.choice(len(pairs), 20, replace=False)]
    length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    return SpringBody(
        nodes, ends, length * rng.uniform(0.5, 1.5, 20), rng.uniform(1, 9, 20), rng.uniform(0.1, 2, 20),
        rng.uniform(0.5, 2, 10), np.array(fixed, dtype=np.int64), slack,
    )  # fmt: skip


@pytest.mark.parametrize("slack", [False, True])
def test_gradient_and_tangent_are_derivatives_of_the_energy(slack: bool) -> None:
    rng = np.random.default_rng(1)
    body = random_body(rng, slack=slack)
    x = body.nodes + 0.1 * rng.standard_normal((10, 3))

    def energy(at: np.ndarray) -> float:
        return add_whole_gradient(body, at, np.zeros_like(at))

    def gradient(at: np.ndarray) -> np.ndarray:
        g = np.zeros_like(at)
        add_whole_gradient(body, at, g)
        return g

    assert_gradient(energy, gradient(x), x, rng, h=1e-6, rel=1e-7)
    H = hessian(body, x, project=False)
    assert_symmetric(H)
    assert np.linalg.eigvalsh(H).min() < -0.1 or slack  # compressed springs: what projection is for
    assert_derivative(gradient, H, x, rng, h=1e-6, rel=1e-7)


def test_the_damper_of_a_stage_is_a_potential_of_the_lengths() -> None:
    rng = np.random.default_rng(2)
    body = random_body(rng)
    links = links_of(body.ends, body.rest_length, body.stiffness, body.damping, False)
    x = body.nodes + 0.1 * rng.standard_normal((10, 3))
    reference = body.rest_length * rng.uniform(0.8, 1.2, 20)

    def gradient(at: np.ndarray) -> np.ndarray:
        g = np.zeros_like(at)
        add_gradient(at, links, 30.0, reference, g)
        return g

    assert_gradient(lambda at: add_gradient(at, links, 30.0, reference, np.zeros_like(at)), gradient(x), x, rng,
                    h=1e-6, rel=1e-7)  # fmt: skip
    blocks = np.zeros((20, 6))
    tangents(x, links, 30.0, reference, False, blocks)
    H = np.zeros((30, 30))
    for k in range(30):
        unit, column = np.zeros((10, 3)), np.zeros((10, 3))
        unit.ravel()[k] = 1.0
        add_products(body.ends, blocks, unit, 1.0, column)
        H[:, k] = column.ravel()
    assert_derivative(gradient, H, x, rng, h=1e-6, rel=1e-7)


def test_projection_leaves_stretched_springs_and_makes_compressed_ones_harmless() -> None:
    rng = np.random.default_rng(3)
    body = random_body(rng)
    x = body.nodes
    exact, projected = (hessian(body, x, project=p) for p in (False, True))
    assert np.linalg.eigvalsh(exact).min() < -0.1
    assert np.linalg.eigvalsh(projected).min() > -1e-12
    stretched = SpringBody(
        x,
        body.ends,
        0.3 * body.rest_length,
        body.stiffness,
        body.damping,
        body.mass,
    )
    assert np.array_equal(hessian(stretched, x, project=False), hessian(stretched, x, project=True))


def test_forces_of_springs_and_dampers_keep_momentum_and_turn_with_the_body() -> None:
    rng = np.random.default_rng(4)
    body = random_body(rng)
    links = links_of(body.ends, body.rest_length, body.stiffness, body.damping, False)
    x, v = body.nodes, rng.standard_normal((10, 3))

    def force(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        f = np.zeros_like(x)
        add_forces(x, v, links, f)
        return f

    f = force(x, v)
    np.testing.assert_allclose(f.sum(axis=0), 0, atol=1e-13)
    R = random_rotation(rng)
    np.testing.assert_allclose(force(x @ R.T, v @ R.T), f @ R.T, atol=1e-12)
    assert np.vdot(v, f - force(x, 0 * v)) < -0.1  # damping takes energy
    np.testing.assert_allclose(np.cross(x, f).sum(axis=0), 0, atol=1e-12)  # central forces: no torque either


@pytest.mark.parametrize(
    ("stretch", "speed", "tension"), [(0.1, 0.0, 0.5), (0.1, 0.2, 1.1), (0.1, -0.2, 0.0), (-0.1, 0.2, 0.0)]
)
@pytest.mark.parametrize("c", [0.0, 2.0])
def test_a_slack_spring_is_damped_by_stiffness_while_it_is_taut_and_by_its_own_damper_always(
    stretch: float, speed: float, tension: float, c: float
) -> None:
    """T = c dl/dt + max(0, k (l - L) + b k dl/dt), k = 5 N/m, b k = 3 N s/m; at velocities and in a stage."""
    x, v = np.array([[0.0, 0, 0], [1.0 + stretch, 0, 0]]), np.array([[0.0, 0, 0], [speed, 0, 0]])
    links = links_of(np.array([[0, 1]]), np.ones(1), np.full(1, 5.0), np.full(1, c), True, 3.0 / 5.0)
    f, g, s = np.zeros_like(x), np.zeros_like(x), 1e-2
    add_forces(x, v, links, f)
    assert f[0, 0] == pytest.approx(tension + c * speed, abs=1e-12)
    add_gradient(x, links, 1 / s, np.array([1.0 + stretch - s * speed]), g)
    assert g[1, 0] == pytest.approx(tension + c * speed, abs=1e-12)


def test_a_slack_spring_pulls_and_does_not_push() -> None:
    x = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    ends, one, mass = np.array([[0, 1]]), np.ones(1), np.ones(2)
    for rest, tension in ((0.8, 0.2 * 7), (1.2, 0.0)):
        body = SpringBody(x, ends, one * rest, one * 7, 0 * one, mass, slack=True)
        g = np.zeros((2, 3))
        add_whole_gradient(body, x, g)
        np.testing.assert_allclose(g, [[-tension, 0, 0], [tension, 0, 0]], atol=1e-14)
    body = SpringBody(x, ends, one * 1.2, one * 7, 0 * one, mass)
    g = np.zeros((2, 3))
    add_whole_gradient(body, x, g)
    np.testing.assert_allclose(g, [[1.4, 0, 0], [-1.4, 0, 0]], atol=1e-14)


@pytest.mark.parametrize("apart", [0.0, 5e-324, 1e-200, 1e-30])
def test_a_spring_of_no_length_makes_no_number_that_is_not_finite(apart: float) -> None:
    one = np.ones(1)
    x = np.array([[0.0, 0, 0], [apart, 0, 0]])
    body = SpringBody(x, np.array([[0, 1]]), one, one, one, np.ones(2))
    g = np.zeros((2, 3))
    assert np.isfinite(add_whole_gradient(body, x, g))
    assert np.isfinite(g).all()
    assert np.isfinite(hessian(body, x, project=True)).all()
    f = np.zeros((2, 3))
    add_forces(x, np.ones((2, 3)), force_of(body).links, f)
    assert np.isfinite(f).all()


def test_a_spring_of_rest_length_zero_is_linear_through_zero() -> None:
    one = np.ones(1)
    body = SpringBody(np.zeros((2, 3)), np.array([[0, 1]]), 0 * one, 5 * one, 0 * one, np.ones(2))
    H = hessian(body, np.zeros((2, 3)), project=False)
    np.testing.assert_array_equal(H, 5 * np.kron([[1, -1], [-1, 1]], np.eye(3)))


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"ends": [[0, 2]]}, ("springs 0 name nodes", "0..1")),
        ({"ends": [[1, 1]]}, ("springs 0 begin", "same node")),
        ({"stiffness": [np.nan]}, ("springs 0: stiffness", "finite", "not negative")),
        ({"rest_length": [-1.0]}, ("springs 0: rest_length",)),
        ({"damping": [np.inf]}, ("springs 0: damping",)),
        ({"mass": [1.0, 0.0]}, ("nodes 1: mass", "finite", "positive")),
        ({"fixed": [7]}, ("fixed nodes 7 do", "nodes 0..1")),
        ({"fixed": [0, 1]}, ("every node", "fixed")),
    ],
)
def test_bad_bodies_are_named(change: dict, named: tuple[str, ...]) -> None:
    good = {"nodes": [[0, 0, 0], [1, 0, 0]], "ends": [[0, 1]], "rest_length": [1.0], "stiffness": [1.0],
            "damping": [0.0], "mass": [1.0, 1.0], "fixed": [0]}  # fmt: skip
    SpringBody(**good)
    with raises_naming(SceneError, *named):
        SpringBody(**{**good, **change})
