"""Damping by stiffness: a potential of the rate of strain, from which rigid motions lose nothing, in every scheme."""

import numpy as np
import pytest
from scipy import sparse

from tests.checks import assert_derivative, assert_gradient, law_vector, random_rotation
from tests.sim.test_elements import block
from tests.tiers import sampled
from tripod_sim.constraints.groups import Groups
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.elastic import Elastic, ElasticTerm
from tripod_sim.forces.solid import Solid
from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.schemes import SCHEMES
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import halving
from tripod_sim.materials.laws import NAMES
from tripod_sim.state import State
from tripod_sim.system import System

NONE = np.zeros(0, dtype=np.int64)
B = 2e-3
"""b [s]."""

LAMBDA, MU = 4e5, 1e5


def solid_of(element: str, law: str, size: float = 0.02) -> tuple[np.ndarray, Solid]:
    """Return the nodes of a small block [m], and its elasticity with a damper."""
    mesh = block(ELEMENTS[element], (2, 1, 1))
    nodes = size * mesh.nodes
    parameters = law_vector(law, LAMBDA, MU)
    return nodes, Solid(nodes, np.array(mesh.elements), ELEMENTS[element], law, parameters, "", B)


def springs_of(*, slack: bool) -> tuple[np.ndarray, SpringForce]:
    """Return nodes of a cube [m], joined by springs along edges and diagonals, with dampers."""
    nodes = 0.02 * np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], dtype=float)
    ends = np.array([(i, j) for i in range(8) for j in range(i)])
    length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    stiffness = np.linspace(300.0, 900.0, len(ends))
    return nodes, SpringForce(
        ends, length, stiffness, np.zeros(len(ends)), slack=slack, owner="net", viscosity=B
    )


def dampers() -> list[tuple[str, str]]:
    """Return every element with a law, and every law with an element."""
    laws = sorted(NAMES)
    found = [(e, laws[k % len(laws)]) for k, e in enumerate(sorted(ELEMENTS))]
    return sorted({*found, *(("h8_mean", law) for law in laws), *(("h8_modes", law) for law in laws)})


def term_of(element: str, law: str) -> tuple[np.ndarray, ElasticTerm]:
    return springs_of(slack=law == "slack") if element == "springs" else solid_of(element, law)


EVERY = [*dampers(), ("springs", "both"), ("springs", "slack")]


@pytest.mark.parametrize(("element", "law"), EVERY)
def test_the_force_is_the_gradient_of_a_potential_and_its_matrix_the_derivative(
    element: str, law: str
) -> None:
    nodes, term = term_of(element, law)
    rng, s = np.random.default_rng(7), 1e-3
    elastic = Elastic([term], NONE, damped=True)
    modes = elastic.rest_modes()
    modes += 1e-4 * rng.standard_normal(modes.shape)
    own, before = elastic.of(modes, 0), np.zeros(term.remembers)
    x = 1.02 * nodes + 3e-4 * rng.standard_normal(nodes.shape)
    elastic.remember(x + 2e-4 * rng.standard_normal(nodes.shape), modes, before, known=False)
    elastic.aim(s, before)
    term.forget()  # gradients at fixed modes

    def energy(at: np.ndarray) -> float:
        return sum(elastic.add_gradients(at, modes, *np.zeros((2, *nodes.shape))))

    def gradient(at: np.ndarray) -> np.ndarray:
        g = np.zeros_like(at)
        elastic.add_gradients(at, modes, g, g)
        return g

    g, d = np.zeros((2, *nodes.shape))
    stored, damped = elastic.add_gradients(x, modes, g, d)
    assert stored == pytest.approx(term.energy(x, own), rel=1e-12)
    assert damped == pytest.approx(elastic.add_damper_gradient(x, modes, np.zeros_like(x)), rel=1e-12)
    assert np.abs(d).max() > 0.1 * np.abs(g).max()
    assert_gradient(energy, g + d, x, rng, h=1e-8, rel=1e-5)
    if term.has_modes:
        return  # the matrix is condensed: see the next test
    elastic.stiffness(x, modes, project=False)
    assert_derivative(gradient, assembled(term, nodes), x, rng, h=1e-8, rel=1e-5)
    elastic.stiffness(x, modes, project=True)
    values = np.linalg.eigvalsh(assembled(term, nodes))
    assert values[0] > -1e-9 * values[-1]


def assembled(term: ElasticTerm, nodes: np.ndarray) -> np.ndarray:
    """Return the sum of the element matrices [N/m], shape (3 n, 3 n)."""
    K = np.zeros((nodes.size, nodes.size))
    for own, block_ in zip(term.elements, term.matrices, strict=True):
        rows = (3 * own[:, None] + np.arange(3)).ravel()
        K[np.ix_(rows, rows)] += block_
    return K


@pytest.mark.parametrize("element", ["t4", "h8", "h8_mean", "h8_modes", "h20"])
def test_an_element_that_is_inside_out_has_no_damper_in_the_stage(element: str) -> None:
    """Once its stiffness is written: gradient and potential fit each other, and the next stage has it again."""
    nodes, solid = solid_of(element, "stable_neo_hooke")
    rng = np.random.default_rng(2)
    modes, before = solid.rest_modes(), np.zeros(solid.remembers)
    x = nodes + 2e-4 * rng.standard_normal(nodes.shape)
    corner = solid.elements[0, 0]
    x[corner] += 2.5 * (nodes[solid.elements[0]].mean(axis=0) - nodes[corner])
    turned = solid.worst_element(x, modes)
    assert turned[1] < 0
    solid.remember(nodes, modes, before, known=False)

    def both(at: np.ndarray) -> tuple[float, np.ndarray]:
        d = np.zeros_like(at)
        return solid.add_damper_gradient(at, modes, d), d

    solid.aim(1e-3, before)
    solid.forget()
    whole, forces = both(x)
    own = np.setdiff1d(solid.elements[turned[0]], np.delete(solid.elements, turned[0], axis=0))
    assert not len(own) or np.abs(forces[own]).max() > 0
    solid.stiffness(x, modes, damper=True, project=True)
    solid.forget()
    less, forces = both(x)
    assert 0 <= less < whole
    assert not forces[own].any()
    if forces.any():  # of the elements that are not inside out
        assert_gradient(lambda at: both(at)[0], forces, x, rng, h=1e-8, rel=1e-5)
    solid.aim(1e-3, before)
    assert both(x)[0] == whole


@pytest.mark.parametrize("law", sorted(NAMES))
def test_modes_are_condensed_where_energy_and_damper_are_least_together(law: str) -> None:
    """The condensed gradient is that of the minimum over the modes, and the condensed matrix its derivative."""
    nodes, term = solid_of("h8_modes", law)
    rng, s = np.random.default_rng(8), 1e-3
    elastic = Elastic([term], NONE, damped=True)
    modes, before = elastic.rest_modes(), np.zeros(term.remembers)
    x = nodes + 4e-4 * rng.standard_normal(nodes.shape)
    elastic.remember(nodes + 4e-4 * rng.standard_normal(nodes.shape), modes, before, known=False)
    elastic.aim(s, before)

    def rest(at: np.ndarray) -> tuple[float, np.ndarray]:
        assert elastic.stiffness(at, modes, project=True) < 0
        assert elastic.settle_modes(at, modes, 1e-24) <= 1e-24
        g = np.zeros_like(at)
        return sum(elastic.add_gradients(at, modes, g, g)), g

    assert elastic.mode_residual_squared < 1e-20
    assert_gradient(lambda at: rest(at)[0], rest(x)[1], x, rng, h=1e-8, rel=1e-5)
    rest(x)
    assert elastic.stiffness(x, modes, project=False) < 0
    K = assembled(term, nodes)
    assert_derivative(lambda at: rest(at)[1], K, x, rng, h=1e-8, rel=1e-5)
    alone, kept = Elastic([term], NONE), modes.copy()
    alone.settle_modes(x, modes, 1e-24)
    assert np.abs(modes - kept).max() > 1e-6  # without the damper modes are elsewhere


@pytest.mark.parametrize(("element", "law"), EVERY)
def test_a_rigid_motion_is_not_damped(element: str, law: str) -> None:
    """By any angle in one stage, from a deformed shape; and at no velocity of a rotation."""
    nodes, term = term_of(element, law)
    rng = np.random.default_rng(9)
    elastic = Elastic([term], NONE, damped=True)
    modes, x = elastic.rest_modes(), 1.1 * nodes + 5e-4 * rng.standard_normal(nodes.shape)
    modes += 1e-4 * rng.standard_normal(modes.shape)
    before, R, spin = np.zeros(term.remembers), random_rotation(rng), rng.standard_normal(3)
    elastic.remember(x, modes, before, known=False)
    elastic.aim(1e-3, before)
    found, force = [], []
    for at, turned in ((x @ R.T + 0.1, modes @ R.T), (x * [1.001, 1.0, 1.0], modes)):
        d = np.zeros_like(x)
        found.append(elastic.add_damper_gradient(at, turned, d))
        force.append(np.abs(d).max())
    assert found[0] < 1e-20 * found[1]
    assert force[0] < 1e-9 * force[1]
    force = []
    elastic.forget()  # of modes that are zero, the rates are
    for v in (np.cross(spin, x), x * [1.0, 0.0, 0.0]):
        d = np.zeros_like(x)
        elastic.add_rates(x, 0.0 * modes, v, 1.0, d)
        force.append(np.abs(d).max())
    assert force[0] < 1e-12 * force[1]


def damped_system(element: str, law: str, fixed: np.ndarray = NONE) -> tuple[System, Anchor, np.ndarray]:
    """Return a block or a net, held at `fixed` nodes, of 8 g."""
    nodes, term = term_of(element, law)
    n = len(nodes)
    inertia, mass = Anchor(n), np.full(n, 0.008 / n)
    groups = Groups(n, fixed=fixed)
    return System(nodes, [term], groups, [inertia], damped=True), inertia, mass


def stiffness_of(system: System) -> np.ndarray:
    """Return the reduced stiffness of the undeformed body [N/m]."""
    still = System(system.rest, system.elastic.terms, system.groups)
    still.assemble(still.undeformed(np.zeros(1)), project=False)
    still.write_hessian()
    upper = still.reduction.pattern
    return np.asarray((upper + sparse.triu(upper, 1).T).todense())


IMPLICIT = ("implicit_euler", "bdf2", "tr_bdf2")


def oscillator(scheme: str, square: float, b: float, h: float, steps: int) -> np.ndarray:
    """Return x of x'' = -w² x - b w² x' from x = 1 at rest, by a scheme, shape (steps + 1,)."""
    A, y = np.array([[0.0, 1.0], [-square, -b * square]]), np.array([1.0, 0.0])
    found = [y]
    one = np.eye(2)
    if scheme in IMPLICIT:
        change, rate, before = np.zeros(2), np.zeros(2), 0.0
        for _ in range(steps):
            for stage in SCHEMES[scheme].stages(h, before):
                assert stage.position == stage.velocity and stage.s_force == stage.s
                known = y + stage.position.change * change + stage.position.rate * rate
                s = stage.s
                after = np.linalg.solve(one - s * A, known)
                change, rate, y = after - y, (after - known) / s, after
            before = h if scheme != "implicit_euler" else 0.0
            found.append(y)
        return np.array(found)[:, 0]
    for _ in range(steps):
        if scheme == "rk4":
            z = h * A
            y = (one + z + z @ z / 2 + z @ z @ z / 6 + z @ z @ z @ z / 24) @ y
        else:
            x, v = y
            v += h * (-square * x - b * square * v)
            y = np.array([x + h * v, v])
        found.append(y)
    return np.array(found)[:, 0]


@pytest.mark.parametrize("scheme", [*IMPLICIT, "semi_implicit_euler", "rk4"])
@pytest.mark.parametrize(("element", "law"), [c for c in EVERY if c[1] != "slack"])
def test_small_vibrations_are_damped_as_the_scheme_damps_an_oscillator(
    element: str, law: str, scheme: str
) -> None:
    """x'' + b w² x' + w² x = 0 in a mode of the undeformed body: the scheme's recurrence, to 0.1 % of its damping."""
    fixed = np.arange(4)
    system, inertia, mass = damped_system(element, law, fixed)
    free, K = system.reduction.free, stiffness_of(system)
    squares, shapes = np.linalg.eigh(K / mass[0])
    explicit, steps = scheme not in IMPLICIT, 60
    k = -1 if explicit else 1
    square, shape = squares[k], shapes[:, k]
    h = 0.2 / max(np.sqrt(square), B * square) if explicit else 0.2 / np.sqrt(square)
    state = system.start_state(np.zeros(1))
    size = 1e-7 / np.abs(shape).max()
    state.positions[free] += size * shape.reshape(-1, 3)
    if explicit:
        system = System(system.rest, system.elastic.terms, system.groups)
        stepper = ExplicitSteps(system, mass, SCHEMES[scheme], drag=0.0, divide=False)
    else:
        newton = Newton(system, 3e-11, 200)  # rounding leaves up to 1.1e-11
        stepper = halving(ImplicitSteps(SCHEMES[scheme], ImplicitStage(newton, inertia, mass, 0.0)), 0)
    found = [1.0]
    for _ in range(steps):
        stepper.step(state, np.zeros(1), h)
        found.append(float((state.positions - system.rest)[free].ravel() @ shape) / size)
    expected, undamped = (oscillator(scheme, square, b, h, steps) for b in (B, 0.0))
    effect = np.abs(expected - undamped).max()
    assert effect > 1e-3
    assert np.abs(np.array(found) - expected).max() < 1e-3 * effect


def free_body(element: str, law: str, *, damped: bool) -> tuple[System, Anchor, np.ndarray, State]:
    """Return a free block or net of 8 g that turns about its centre at 20 rad/s, and vibrates."""
    system, inertia, mass = damped_system(element, law)
    if not damped:
        system = System(system.rest, system.elastic.terms, system.groups, [inertia])
    state = system.start_state(np.zeros(1))
    centred = state.positions - state.positions.mean(axis=0)
    state.velocities[:] = np.cross(SPIN, centred)
    return system, inertia, mass, state


SPIN = np.array([0.0, 0.0, 20.0])


def angular_momentum(mass: np.ndarray, state: State) -> float:
    """Return its part along `SPIN` [kg m²/s], about the origin: the centre of mass is at rest."""
    return float((mass[:, None] * np.cross(state.positions, state.velocities)).sum(axis=0) @ SPIN) / 20.0


QUICK = tuple(
    (*next(case for case in EVERY if kind in case), scheme)
    for kind, scheme in (("t4", "tr_bdf2"), ("h8_modes", "bdf2"), ("slack", "tr_bdf2"))
)


@pytest.mark.parametrize(
    ("element", "law", "scheme"),
    sampled([(*case, s) for case in EVERY for s in ("bdf2", "tr_bdf2")], QUICK[0], QUICK[2]),
)
def test_a_free_body_keeps_its_spin_as_without_damping(element: str, law: str, scheme: str) -> None:
    """In 1 s of 2 ms steps at 20 rad/s, within 0.1 percentage points of the same run undamped.

    No torque acts (Newton). The tangent times the velocity took 38 % of a stressed piece's spin.
    """
    left = []
    for damped in (False, True):
        system, inertia, mass, state = free_body(element, law, damped=damped)
        start = angular_momentum(mass, state)
        newton = Newton(system, 1e-9, 100)
        stepper = halving(ImplicitSteps(SCHEMES[scheme], ImplicitStage(newton, inertia, mass, 0.0)), 0)
        for _ in range(500):
            stepper.step(state, np.zeros(1), 0.002)
        left.append(100 * angular_momentum(mass, state) / start)
    assert left[0] < 99.95  # what the scheme itself takes
    assert left[1] == pytest.approx(left[0], abs=0.1)


@pytest.mark.parametrize(
    ("element", "law", "scheme"), sampled([(*case, s) for case in EVERY for s in IMPLICIT], *QUICK)
)
def test_the_energy_of_a_free_damped_body_rises_no_more_than_undamped(
    element: str, law: str, scheme: str
) -> None:
    """Above its least so far, of a body that turns and vibrates: implicit Euler's not at all."""
    risen, now = [], np.zeros(0)
    for damped in (False, True):
        system, inertia, mass, state = free_body(element, law, damped=damped)
        state.velocities += 0.3 * np.random.default_rng(3).standard_normal(state.velocities.shape)
        stepper = halving(
            ImplicitSteps(SCHEMES[scheme], ImplicitStage(Newton(system, 1e-9, 100), inertia, mass, 0.0)), 4
        )
        now = np.zeros(60)
        for k in range(len(now)):
            stepper.step(state, np.zeros(1), 5e-4)
            now[k] = 0.5 * float(mass @ (state.velocities**2).sum(axis=1)) + system.potentials(state)[0]
        risen.append((now - np.minimum.accumulate(now)).max() / now[0])
    assert risen[1] <= (0.0 if scheme == "implicit_euler" else risen[0]) + 1e-7
    assert now[-1] < 0.99 * now[0]


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4"])
@pytest.mark.parametrize(
    ("element", "law"), [("h8_modes", "neo_hooke"), ("h8_mean", "yeoh"), ("springs", "slack")]
)
def test_explicit_schemes_keep_the_spin_of_a_free_damped_body(element: str, law: str, scheme: str) -> None:
    system, _, mass, state = free_body(element, law, damped=True)
    system = System(system.rest, system.elastic.terms, system.groups)
    stepper, start = (
        ExplicitSteps(system, mass, SCHEMES[scheme], drag=0.0, divide=True),
        angular_momentum(mass, state),
    )
    for _ in range(5):
        stepper.step(state, np.zeros(1), 2e-3)
    assert angular_momentum(mass, state) == pytest.approx(start, rel=1e-7)


def test_explicit_and_implicit_schemes_damp_a_large_swing_alike() -> None:
    """Modes follow the nodes by the elastic forces in the one, by these and the dampers' in the other."""
    ends = []
    for scheme in ("rk4", "tr_bdf2", "none"):
        system, inertia, mass = damped_system("h8_modes", "neo_hooke", np.arange(4))
        if scheme == "none":
            system = System(system.rest, system.elastic.terms, system.groups, [inertia])
        state = system.start_state(np.zeros(1))
        state.velocities[4:] = 3.0 * np.random.default_rng(1).standard_normal((8, 3))
        if scheme == "rk4":
            system = System(system.rest, system.elastic.terms, system.groups)
            stepper = ExplicitSteps(system, mass, SCHEMES[scheme], drag=0.0, divide=True)
        else:
            stage = ImplicitStage(Newton(system, 1e-8, 100), inertia, mass, 0.0)
            stepper = halving(ImplicitSteps(SCHEMES["tr_bdf2"], stage), 4)
        for _ in range(200):
            stepper.step(state, np.zeros(1), 2e-5)
        ends.append(state.positions - system.rest)
    effect = np.abs(ends[2] - ends[1]).max()
    assert effect > 1e-3  # of 20 mm
    assert np.abs(ends[0] - ends[1]).max() < 0.02 * effect
