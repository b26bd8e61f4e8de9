"""Elastic terms in one system: solids divided into several, springs beside them, dampers in every scheme."""

import numpy as np
import pytest
from scipy import sparse

from tests.checks import assert_derivative, assert_gradient, law_vector
from tests.messages import raises_naming
from tests.sim.implicit_schemes import IMPLICIT, scheme_of
from tripod_sim import load_scene
from tripod_sim.build import build
from tripod_sim.constraints.groups import Groups
from tripod_sim.errors import SceneError
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.elastic import Elastic
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.forces.solid import Solid
from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.schemes import SCHEMES
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import halving
from tripod_sim.mesh.y_piece import LEVELS, y_piece
from tripod_sim.system import System

NONE = np.zeros(0, dtype=np.int64)


def halves(law: str, kind_of_second: str = "same") -> tuple[Elastic, Elastic, np.ndarray]:
    """The elasticity of the piece as one solid and as two, which share nodes."""
    mesh = y_piece(LEVELS[1])
    every, half = np.array(mesh.elements), len(mesh.elements) // 2

    def solid(elements: np.ndarray) -> Solid:
        return Solid(mesh.nodes, np.ascontiguousarray(elements), mesh.kind, law, law_vector(law, 1e5, 1e5))

    return (
        Elastic([solid(every)], NONE),
        Elastic([solid(every[:half]), solid(every[half:])], NONE),
        mesh.nodes,
    )


@pytest.mark.parametrize("share", [1e-12, 1e-5])
def test_the_largest_stiffness_is_in_proportion_however_soft_the_body_is(share: float) -> None:
    found = []
    for factor in (1.0, share):
        mesh = y_piece(LEVELS[1])
        solid = Solid(
            mesh.nodes,
            np.array(mesh.elements),
            mesh.kind,
            "neo_hooke",
            law_vector("neo_hooke", 1e5 * factor, 1e5 * factor),
        )
        elastic = Elastic([solid], NONE)
        elastic.stiffness(np.array(mesh.nodes), elastic.rest_modes(), project=False)
        found.append(elastic.largest_stiffness())
    assert found[1] == pytest.approx(share * found[0], rel=1e-9)


@pytest.mark.parametrize("law", ["neo_hooke", "corotational"])
def test_a_solid_in_two_terms_is_the_same_solid(law: str) -> None:
    one, two, nodes = halves(law)
    rng = np.random.default_rng(1)
    x, dx = nodes + 1e-4 * rng.standard_normal(nodes.shape), 1e-4 * rng.standard_normal(nodes.shape)
    found = []
    for elastic in (one, two):
        modes, after = elastic.rest_modes(), elastic.rest_modes()
        assert elastic.stiffness(x, modes, project=True) == -1
        g, response = np.zeros_like(x), np.zeros_like(x)
        energy = elastic.add_gradient(x, modes, g)
        assert energy == pytest.approx(elastic.energy(x, modes), rel=1e-12)
        work = elastic.add_products(elastic.matrices, dx, 2.0, response)
        elastic.advance_modes(modes, dx, 1.0, after)
        found.append((g, response, after, energy, work, elastic.mode_residual_squared))
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-12 * np.abs(a).max())
    assert found[0][5] > 0
    assert two.culprit(x, two.rest_modes()) == min(
        t.culprit(x, t.rest_modes()) for t in two.terms
    )[1]  # fmt: skip


def test_springs_beside_a_solid_have_the_gradient_and_hessian_of_their_energy() -> None:
    mesh, rng = y_piece(LEVELS[1]), np.random.default_rng(2)
    n = len(mesh.nodes)
    ends = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    length = np.linalg.norm(np.diff(mesh.nodes, axis=0), axis=1)
    stiffness = np.full(n - 1, 300.0)
    springs = SpringForce(ends, 0.9 * length, stiffness, np.zeros(n - 1), slack=False, owner="net")
    solid = Solid(
        mesh.nodes, np.array(mesh.elements), mesh.kind, "neo_hooke", law_vector("neo_hooke", 1e4, 1e4)
    )
    system = System(mesh.nodes, [springs, solid], Groups(n))
    state = system.start_state(np.zeros(1))
    state.positions += 1e-4 * rng.standard_normal((n, 3))
    modes = state.modes.copy()
    system.elastic.forget()  # gradients at fixed modes

    def energy(x: np.ndarray) -> float:
        return system.elastic.energy(x, modes)

    g = np.zeros((n, 3))
    system.elastic.add_gradient(state.positions, modes, g)
    assert_gradient(energy, g, state.positions, rng, h=1e-8, rel=1e-6)

    def gradient(x: np.ndarray) -> np.ndarray:
        out = np.zeros_like(x)
        springs.add_gradient(x, np.zeros((n - 1, 0, 3)), out)
        return out

    system.assemble(state, project=False)
    for matrices in (system.elastic.matrices[1],):
        matrices[:] = 0.0  # the springs' part alone
    system.write_hessian()
    upper = system.reduction.pattern
    H = (upper + sparse.triu(upper, 1).T).tocsr()
    assert_derivative(gradient, H, state.positions, rng, h=1e-8, rel=1e-5)
    springs.stiffness(state.positions, np.zeros((n - 1, 0, 3)), project=True)
    assert np.linalg.eigvalsh(springs.matrices).min() > -1e-9


@pytest.mark.parametrize("scheme", [s for s in IMPLICIT if scheme_of(s).has_one_length])
@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_a_chain_as_a_term_moves_as_in_the_loops_of_springs(scheme: str, damping: float) -> None:
    """Dampers too: what the scheme does to positions it does to lengths."""
    words = (
        f"inertia.scheme={scheme}", "springs.nodes=6", f"springs.damping={damping}", "solver.tolerance=1e-9",
        "solver.linear=ldl", "solver.max_iterations=100", "dt=0.005", "springs.stiffness=200.0",
    )  # fmt: skip
    parts = build(load_scene("pendulum", words))
    body, expected = parts.mesh, parts.system.start_state(np.zeros(1))
    n, mass = len(body.nodes), np.array(body.mass)
    inertia = Anchor(n)
    springs = SpringForce(
        body.ends, body.rest_length, body.stiffness, body.damping, slack=body.slack, owner="chain"
    )
    others = [GravityForce(mass, (0.0, 0.0, -9.81), body.nodes), inertia]
    system = System(body.nodes, [springs], Groups(n, fixed=body.fixed), others, damped=True)
    stepper = halving(
        ImplicitSteps(SCHEMES[scheme], ImplicitStage(Newton(system, 1e-6, 100), inertia, mass, 0.0)), 8
    )
    state = system.start_state(np.zeros(1))
    for _ in range(40):
        parts.stepper.step(expected, np.zeros(1), 0.005)
        stepper.step(state, np.zeros(1), 0.005)
    assert np.abs(expected.positions - body.nodes).max() > 0.05
    np.testing.assert_allclose(state.positions, expected.positions, rtol=0, atol=1e-8)


def test_an_explicit_scheme_refuses_an_elastic_term_that_its_loops_do_not_know() -> None:
    one, _, nodes = halves("neo_hooke")
    solid = one.terms[0]
    solid.solid = None
    system = System(nodes, [solid], Groups(len(nodes)))
    with raises_naming(SceneError, "rk4", "Solid"):
        ExplicitSteps(system, np.ones(len(nodes)), SCHEMES["rk4"], drag=0.0, divide=True)
