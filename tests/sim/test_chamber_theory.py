"""Hollow bodies under a pressure that follows the surface, against exact solutions; the way there; what has none."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from benchmarks.blocks import lumped
from tests.messages import assert_names, raises_naming
from tests.sim.hollow_bodies import commanded, on_axes, pressurised, sphere_shell, tube
from tests.sim.implicit_schemes import scheme_of
from tripod_host.arrays import FloatArray
from tripod_sim.errors import UnsolvedError
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.chamber import Chamber
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.forces.term import Term
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.quasi_static import quasi_static_steps
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.materials.lame import lame_constants
from tripod_sim.mesh.cavity import cavity_faces, faces_of_set
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.state import State
from tripod_sim.system import System

INNER, OUTER, YOUNG = 0.01, 0.02, 1e5
"""Radii [m] and modulus [Pa]."""

SPHERE, CYLINDER = 2, 1
"""Directions around the axis or centre in which a body is stretched alike."""


def exact_stretch(around: int, pressure: float, poisson: float) -> float:
    """Return r/R at the inner radius of the compressible neo-Hookean body: its radial equation by collocation.

    psi = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)², a nominal pressure p J / l_r inside, none outside:
    dP_r/dR + around (P_r - P_t) / R = 0 with P_i = dpsi/dl_i.
    """
    lam, mu = lame_constants(YOUNG, poisson)
    bulk = lam + 2 * mu / 3

    def nominal(radial: FloatArray, hoop: FloatArray) -> tuple[FloatArray, FloatArray]:
        one = np.ones_like(radial)
        stretches = (radial, hoop, hoop if around == SPHERE else one)
        ratio = stretches[0] * stretches[1] * stretches[2]
        first = stretches[0] ** 2 + stretches[1] ** 2 + stretches[2] ** 2
        found = [
            mu * ratio ** (-2 / 3) * (s - first / (3 * s)) + bulk * (ratio - 1) * ratio / s for s in stretches
        ]
        return found[0], found[1]

    def slopes(R: FloatArray, y: FloatArray) -> FloatArray:
        radial, hoop, h = y[1], y[0] / R, 1e-30
        p_radial, p_hoop = nominal(radial, hoop)
        by_radial = nominal(radial + 1j * h, hoop + 0j)[0].imag / h
        by_hoop = nominal(radial + 0j, hoop + 1j * h)[0].imag / h
        grown = -around * (p_radial - p_hoop) / R - by_hoop * (radial - hoop) / R
        return np.vstack([radial, grown / by_radial])

    def ends(a: FloatArray, b: FloatArray) -> FloatArray:
        load = pressure * (a[0] / INNER) ** around
        return np.array([nominal(a[1], a[0] / INNER)[0] + load, nominal(b[1], b[0] / OUTER)[0]]) / mu

    R = np.linspace(INNER, OUTER, 41)
    found = solve_bvp(slopes, ends, R, np.vstack([R, np.ones_like(R)]), tol=1e-9, max_nodes=20000)
    assert found.success
    return float(found.y[0, 0] / INNER)


def incompressible_pressure(around: int, stretch: float, shear: float) -> float:
    """Return the pressure [Pa] that stretches the inner radius of an incompressible neo-Hookean body [Ogden1997]."""
    power = around + 1
    outer = (1 + (stretch**power - 1) * (INNER / OUTER) ** power) ** (1 / power)
    if around == SPHERE:
        return shear * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))
    return shear * (np.log(stretch / outer) + (1 / outer**2 - 1 / stretch**2) / 2)


@cache
def body(around: int, cells: int = 4, layers: int = 3) -> tuple[SolidMesh, Chamber]:
    """Return a hollow ball, or a slice of a long cylinder, and its chamber."""
    if around == SPHERE:
        mesh = sphere_shell("h20", INNER, OUTER, cells, layers)
        return mesh, Chamber(cavity_faces(mesh, 0, ""), mesh.nodes)
    mesh = tube("h20", INNER, OUTER, 0.005, cells, layers)
    inner = np.flatnonzero(np.linalg.norm(mesh.nodes[:, :2], axis=1) < INNER + 1e-9)
    return mesh, Chamber(faces_of_set(mesh, inner, "", "", cap=True), mesh.nodes)


def held(
    around: int, poisson: float, *more: Term, damping: float = 0.0, cells: int = 4, layers: int = 3
) -> tuple[System, Chamber]:
    """Return the body with nodes on the axes kept there, the cylinder at its length."""
    mesh, chamber = body(around, cells, layers)
    pins = on_axes(mesh.nodes, 3 if around == SPHERE else 2)
    if around == CYLINDER:
        every = np.arange(len(mesh.nodes))
        pins = np.concatenate([pins, np.stack([every, np.full(len(every), 2)], axis=1)])
    return pressurised(mesh, chamber, pins, YOUNG, poisson, *more, damping=damping), chamber


def stretches(around: int, state: State, cells: int = 4, layers: int = 3) -> FloatArray:
    """Return r/R of each node at the inner radius."""
    mesh = body(around, cells, layers)[0]
    axes = 3 if around == SPHERE else 2
    before, now = (np.linalg.norm(x[:, :axes], axis=1) for x in (mesh.nodes, state.positions))
    inner = before < INNER + 1e-9
    return np.asarray(now[inner] / before[inner])


def rest(system: System, pressure: float, increments: int = 4) -> State:
    """Return the equilibrium, gone to in increments."""
    state, newton = system.start_state(commanded(0.0)), Newton(system, 1e-8, 100)
    for k in range(increments):
        newton.solve(state, commanded(pressure * (k + 1) / increments))
    return state


@pytest.mark.parametrize("around", [SPHERE, CYLINDER])
def test_the_exact_solutions_agree_where_the_volume_can_hardly_change(around: int) -> None:
    mu = lame_constants(YOUNG, 0.4999)[1]
    pressure = incompressible_pressure(around, 1.2, mu)
    assert exact_stretch(around, pressure, 0.4999) == pytest.approx(1.2, rel=2e-4)


@pytest.mark.parametrize("around", [SPHERE, CYLINDER])
@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_a_thick_body_is_stretched_as_the_compressible_law_says(around: int, poisson: float) -> None:
    system, _ = held(around, poisson)
    pressure = incompressible_pressure(around, 1.2, lame_constants(YOUNG, poisson)[1])
    found, exact = (
        stretches(around, rest(system, pressure)),
        exact_stretch(around, pressure, poisson),
    )
    assert exact > 1.199
    np.testing.assert_allclose(found - 1, exact - 1, rtol=5e-3)


@pytest.mark.parametrize("around", [SPHERE, CYLINDER])
def test_a_nearly_incompressible_body_is_stretched_by_the_closed_form(around: int) -> None:
    system, _ = held(around, 0.499)
    pressure = incompressible_pressure(around, 1.2, lame_constants(YOUNG, 0.499)[1])
    np.testing.assert_allclose(stretches(around, rest(system, pressure)), 1.2, rtol=5e-3)


def test_a_dead_pressure_stretches_a_sphere_by_two_thirds_of_that() -> None:
    """Its forces keep their size while the area grows: p l² = p(1.2) at the stretch 1.138."""
    mesh, chamber = body(SPHERE)
    mu = lame_constants(YOUNG, 0.499)[1]
    pressure = incompressible_pressure(SPHERE, 1.2, mu)
    dead = brentq(lambda s: incompressible_pressure(SPHERE, s, mu) * s**2 - pressure, 1.0, 1.2)
    assert dead == pytest.approx(1.138, abs=1e-3)
    loads = NodalLoads(np.array(mesh.nodes))
    chamber.add_coupling(mesh.nodes, loads.force)
    loads.force[:] *= -pressure
    system, chamber = held(SPHERE, 0.499, loads)
    np.testing.assert_allclose(stretches(SPHERE, rest(system, 0.0)), dead, rtol=5e-3)


MASS, COARSE = 0.03, {"cells": 2, "layers": 1}
"""Of the ball [kg]; and of its mesh."""


def stepper(system: System, inertia: Anchor, mesh: SolidMesh) -> Substeps:
    """Return steps of implicit Euler."""
    stage = ImplicitStage(Newton(system, 1e-8, 200), inertia, lumped(mesh, MASS)[1], 1.0)
    return halving(ImplicitSteps(scheme_of("implicit_euler"), stage), 6)


def moving() -> tuple[Substeps, State, Chamber]:
    """Return what makes steps of a hollow ball, its state, and its chamber."""
    mesh, _ = body(SPHERE, **COARSE)
    inertia = Anchor(len(mesh.nodes))
    system, chamber = held(SPHERE, 0.49, inertia, damping=1e-3, **COARSE)
    return stepper(system, inertia, mesh), system.start_state(commanded(0.0)), chamber


def test_it_comes_to_rest_in_the_same_shape_for_every_time_step() -> None:
    """And in that of statics: the pressure has no error of the time step."""
    pressure = 0.48 * lame_constants(YOUNG, 0.49)[1]
    system, _ = held(SPHERE, 0.49, **COARSE)
    still = rest(system, pressure).positions
    for dt in (1e-3, 5e-3, 20e-3):
        steps, state, _ = moving()
        for _ in range(2000):
            steps.step(state, commanded(pressure), dt)
            if np.abs(state.velocities).max() < 1e-9:
                break
        assert np.abs(state.velocities).max() < 1e-9
        np.testing.assert_allclose(state.positions, still, atol=1e-9)
    assert np.abs(still - body(SPHERE, **COARSE)[0].nodes).max() > 1e-3


BLAST = (1.0, 10.0, 100.0, 1e6)


@pytest.mark.parametrize("factor", BLAST)
def test_a_pressure_far_too_large_in_one_step_is_solved_or_refused_by_name(factor: float) -> None:
    steps, state, _ = moving()
    pressure = 0.48 * lame_constants(YOUNG, 0.49)[1]
    for _ in range(20):
        steps.step(state, commanded(pressure), 5e-3)
    good = state.copy()
    with np.errstate(all="raise"):
        try:
            steps.step(state, commanded(factor * pressure), 5e-3)
        except UnsolvedError as error:
            assert factor > 1
            assert "node" in str(error) or "element" in str(error)
            np.testing.assert_array_equal(state.positions, good.positions)
        else:
            assert np.isfinite(state.positions).all() and np.isfinite(state.velocities).all()
            assert factor < 1e6


def statics(system: System, chamber: Chamber, most: float) -> Substeps:
    """Return steps to equilibria, in increments of at most the pressure `most` [Pa], halved where they fail."""
    chamber.span = most
    return quasi_static_steps(Newton(system, 1e-8, 100), 4, 1.0, 1.0, watch=True)


@pytest.mark.parametrize("factor", [100.0, 1e6])
def test_statics_refuse_a_pressure_without_equilibrium(factor: float) -> None:
    system, chamber = held(SPHERE, 0.49, **COARSE)
    pressure = factor * 0.48 * lame_constants(YOUNG, 0.49)[1]
    steps, state = statics(system, chamber, pressure), system.start_state(commanded(0.0))
    good = state.copy()
    with (
        np.errstate(all="raise"),
        raises_naming(UnsolvedError, "chamber", "Pa", "lower the pressure"),
    ):
        steps.step(state, commanded(pressure), 0.0)
    np.testing.assert_array_equal(state.positions, good.positions)


def membrane() -> tuple[System, Chamber, float]:
    """Return a thin sphere, its chamber, and the pressure that it bears at most [Pa].

    That is p = 2 mu t/R (1/l - 1/l⁷), the largest at the stretch l = LIMIT.
    """
    thickness = 2e-4
    mesh = sphere_shell("h20", INNER, INNER + thickness, 4, 1)
    chamber = Chamber(cavity_faces(mesh, 0, ""), mesh.nodes)
    system = pressurised(mesh, chamber, on_axes(mesh.nodes, 3), YOUNG, 0.49)
    shape = thickness / (INNER + thickness / 2) * (1 / LIMIT - LIMIT**-7)
    return system, chamber, 2 * lame_constants(YOUNG, 0.49)[1] * shape


LIMIT = 7 ** (1 / 6)


def test_a_membrane_is_followed_to_its_limit_point_and_refused_beyond() -> None:
    system, chamber, most = membrane()
    steps, state = statics(system, chamber, most), system.start_state(commanded(0.0))
    before, start = 1.0, chamber.surface.volume(system.rest)
    for share in np.linspace(0.05, 1.05, 21):
        try:
            report = steps.step(state, commanded(share * most), 0.0)
        except UnsolvedError as error:
            assert_names(error, "chamber", "Pa", "lower the pressure")
            break
        stretch = (chamber.volume / start) ** (1 / 3)
        assert before < stretch < LIMIT
        assert not report.unstable
        before = stretch
    assert 0.95 < share <= 1.0
    assert before > 1.27


def test_near_the_limit_point_one_increment_leads_where_twenty_do() -> None:
    ends = []
    for increments in (1, 20):
        system, chamber, most = membrane()
        steps, state = statics(system, chamber, most / increments), system.start_state(commanded(0.0))
        report = steps.step(state, commanded(0.97 * most), 0.0)
        assert report.parts >= increments
        ends.append(state.positions)
    np.testing.assert_allclose(*ends, atol=1e-8)
