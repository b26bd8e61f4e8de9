"""Laws of rubber with parameters of their own: closed forms, what a scene may say of them, and bodies made of them."""

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.blocks import brick
from tests.checks import Law, law_vector
from tests.messages import names, raises_naming
from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.forces.solid import Solid
from tripod_sim.forces.solid_arrays import no_solid
from tripod_sim.forces.solid_kernels import ELASTIC, solid_gradient
from tripod_sim.materials import calls
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.law import law_named, vector
from tripod_sim.materials.laws import KAPPA, NAMES
from tripod_sim.tables.bodies import Material
from tripod_sim.tables.materials import initial_young

OWN = {
    "mooney_rivlin": (0.3, 0.1),
    "yeoh": (0.4, -0.03, 0.01),
    "ogden": (0.6, 1.3, 0.01, 5.0, -0.1, -2.0),
}
"""Parameters of each, in MPa, such as measured of rubber."""

STRETCHES = (0.5, 0.8, 1.1, 1.7, 3.0)


def rubber(name: str, poisson: float) -> Law:
    """Return a law with the parameters above; the modulus of volume follows from `poisson`."""
    law, shear = Law(name), law_named(name).shear(OWN[name])
    law.p = vector(name, *lame_constants(2 * (1 + poisson) * shear, poisson), OWN[name])
    return law


def pulled(name: str, k: float) -> float:
    """Force over undeformed section of an incompressible bar at the stretch `k`: [Ogden1997], [Yeoh1993]."""
    own, more = OWN[name], k**2 + 2 / k - 3
    if name == "mooney_rivlin":
        return 2 * (k - k**-2) * (own[0] + own[1] / k)
    if name == "yeoh":
        return 2 * (k - k**-2) * (own[0] + 2 * own[1] * more + 3 * own[2] * more**2)
    return sum(m * (k ** (a - 1) - k ** (-a / 2 - 1)) for m, a in zip(own[::2], own[1::2], strict=True))


def sheared(name: str, g: float) -> float:
    """Shear stress at the amount of shear `g`; the volume stays, so that no modulus of it counts."""
    own = OWN[name]
    if name == "mooney_rivlin":
        return 2 * (own[0] + own[1]) * g
    if name == "yeoh":
        return 2 * g * (own[0] + 2 * own[1] * g**2 + 3 * own[2] * g**4)
    k = g / 2 + np.sqrt(1 + g**2 / 4)
    return sum(m * (k**a - k**-a) / (k + 1 / k) for m, a in zip(own[::2], own[1::2], strict=True))


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("k", STRETCHES)
def test_a_bar_is_pulled_as_the_incompressible_one(name: str, k: float) -> None:
    """At nu = 0.4999999 the volume changes by stress / K, here below 1e-5, and the stress by some times as much."""
    law = rubber(name, 0.4999999)

    def side(across: float) -> float:
        return float(law.stress(np.diag([k, across, across]))[1, 1])

    across = brentq(side, 0.99 * k**-0.5, 1.01 * k**-0.5, xtol=1e-15)
    found = law.stress(np.diag([k, across, across]))[0, 0]
    assert found == pytest.approx(pulled(name, k), rel=1e-4)
    assert np.sign(found) == np.sign(k - 1)


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("g", [0.1, 0.7, 2.0])
@pytest.mark.parametrize("poisson", [0.3, 0.499])
def test_simple_shear(name: str, g: float, poisson: float) -> None:
    F = np.array([[1.0, g, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert rubber(name, poisson).stress(F)[0, 1] == pytest.approx(sheared(name, g), rel=1e-11)


@pytest.mark.parametrize("name", OWN)
def test_a_change_of_volume_alone_meets_the_bulk_modulus(name: str) -> None:
    law = rubber(name, 0.3)
    for k in (0.6, 1.5):
        np.testing.assert_allclose(
            law.stress(k * np.eye(3)), law.p[KAPPA] * (k**3 - 1) * k**2 * np.eye(3), atol=1e-13
        )
        assert law.energy(k * np.eye(3)) == pytest.approx(law.p[KAPPA] / 2 * (k**3 - 1) ** 2, rel=1e-12)
    young = 2 * 1.3 * law_named(name).shear(OWN[name])
    assert law.p[KAPPA] == pytest.approx(young / (3 * (1 - 2 * 0.3)))


def test_each_has_the_simpler_ones_in_it() -> None:
    """Yeoh and Mooney-Rivlin without further terms, and Ogden with alpha 2, are neo-Hooke; with 2 and -2 the second."""
    F = np.array([[1.4, 0.3, 0.1], [-0.2, 0.8, 0.2], [0.0, 0.1, 1.1]])

    def stress(name: str, *own: float) -> np.ndarray:
        law = Law(name)
        law.p = vector(name, 3.0, 1.0, own)
        return law.stress(F)

    plain = stress("neo_hooke")
    for name, own in (("yeoh", (0.5, 0.0, 0.0)), ("mooney_rivlin", (0.5, 0.0)), ("ogden", (1.0, 2.0))):
        np.testing.assert_allclose(stress(name, *own), plain, rtol=1e-12, atol=1e-13)
    both = stress("mooney_rivlin", 0.3, 0.2)
    assert np.abs(both - plain).max() > 0.01
    np.testing.assert_allclose(stress("ogden", 0.6, 2.0, -0.4, -2.0), both, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", NAMES)
def test_newton_converges_quadratically_in_a_bent_strip(name: str) -> None:
    """One end of a strip is turned by half a radian; near the rest each residual is of the square of the one before."""
    mesh = brick("h27", (np.linspace(0, 4, 5), np.linspace(0, 1, 2), np.linspace(0, 0.5, 2)))
    solid = Solid(mesh.nodes, np.array(mesh.elements), mesh.kind, name, law_vector(name, 1.0, 1.0))
    x, modes, turn = np.array(mesh.nodes), solid.rest_modes(), 0.5
    share, radius = x[:, 0] / 4, 4 / turn - x[:, 2]
    x[:, 0], x[:, 2] = radius * np.sin(turn * share), 4 / turn - radius * np.cos(turn * share)
    free = np.flatnonzero(np.repeat((share > 1e-9) & (share < 1 - 1e-9), 3))
    residuals = []
    for _ in range(12):
        g = np.zeros_like(x)
        assert np.isfinite(solid.add_gradient(x, modes, g))
        residuals.append(float(np.linalg.norm(g.ravel()[free])))
        if residuals[-1] < 1e-13:
            break
        assert solid.stiffness(x, modes, project=False) == -1
        K = np.zeros((x.size, x.size))
        for e, k in zip(mesh.elements, solid.matrices, strict=True):
            dofs = (3 * e[:, None] + np.arange(3)).ravel()
            K[np.ix_(dofs, dofs)] += k
        x.ravel()[free] -= np.linalg.solve(K[np.ix_(free, free)], g.ravel()[free])
    near = [r for r in residuals if 1e-13 < r < 2e-3]
    assert residuals[0] > 0.05
    assert residuals[-1] < 1e-13
    assert len(near) >= 2
    for r in near:  # at the last of them linear convergence would leave 1e4 times as much
        assert residuals[residuals.index(r) + 1] < max(50 * r**2, 1e-13)


def made_of(name: str) -> str:
    """Return a material as an override: about as stiff as silicone at first."""
    own = OWN[name]
    scale = 86e3 / law_named(name).shear(own)
    moduli = law_named(name).PARAMETERS
    values = [v * scale if unit.endswith("[Pa]") else v for v, unit in zip(own, moduli, strict=True)]
    return f"material={{law='{name}', parameters={values}, poisson=0.45, mass=0.032}}"


@pytest.mark.parametrize("name", OWN)
def test_the_tripod_of_such_rubber_moves_nearly_as_that_of_silicone(name: str) -> None:
    """Of the same initial moduli: all that follows from these is right, and the strains change it a little."""
    ends = []
    for material in (made_of(name), "material.young=249.4e3"):
        simulation = Simulation(load_scene(SHARP, ["mesh.level=1", material]))
        for k in range(20):
            simulation.step(np.array([-0.3, -0.2, 0.1, 0.005]) * min(1, k / 10))
        assert simulation.effector
        ends.append(simulation.effector.position)
    assert 1e-9 < np.linalg.norm(ends[1] - ends[0]) < 1e-3


@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize("scheme", ["implicit_euler", "tr_bdf2", "semi_implicit_euler"])
def test_schemes_keep_the_energy_of_a_piece_in_free_fall(name: str, scheme: str) -> None:
    words = ["mesh.level=1", made_of(name), f"inertia.scheme={scheme}", "dt=5e-5", "gravity=off"]
    words += ["initial_velocity=[{set='all', velocity=[0,0,0.3], spin=[9,0,0]}]"]
    simulation = Simulation(load_scene("silicone_free", words))
    first = simulation.energies()
    for _ in range(20):
        simulation.step()
    last = simulation.energies()
    assert last.strain > 0
    assert last.kinetic + last.strain == pytest.approx(first.kinetic + first.strain, rel=1e-3)


@pytest.mark.parametrize("name", OWN)
def test_it_falls_onto_an_obstacle(name: str) -> None:
    words = ["mesh.level=1", made_of(name), "obstacles.0.position=[0,0,-0.024]"]
    simulation, pressed = Simulation(load_scene("silicone_drop", words)), 0
    for _ in range(40):
        contact = simulation.step().contact
        assert contact
        pressed += bool(contact.pressed)
    assert pressed


def test_initial_modulus_is_what_others_ask_for() -> None:
    young = initial_young(Material(law="yeoh", poisson=0.3, parameters=(2e4, -1e3, 50.0)))
    assert young == pytest.approx(2 * 1.3 * 4e4)
    assert initial_young(Material(young=1e5)) == 1e5
    clamped = ["servos.angles=[0,0,0]", "mesh_error={}", "clamp.stiffness=1.4e10", "mesh.level=8"]
    load_scene("tripod", [*clamped, made_of("yeoh")])
    with raises_naming(SceneError, "clamp.stiffness", "N/m⁴") as refused:
        load_scene("tripod", [*clamped, "material={law='yeoh', parameters=[1e3, 0, 0]}"])
    assert any(names(refused.value, value) for value in ("1.4e10 N/m⁴", "1.4e+10 N/m⁴"))


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (
            "material.parameters=[1e5]",
            ("material.parameters", "[100000.0]", "neo_hooke", "young", "poisson", "leave"),
        ),
        (
            "material.law=yeoh",
            ("material.young", "250000.0 Pa", "yeoh", "parameters = [c10 [Pa], c20 [Pa], c30 [Pa]]"),
        ),
        (
            "material={law='yeoh'}",
            ("material.parameters", "0 values", "yeoh", "parameters = [c10 [Pa], c20 [Pa], c30 [Pa]]"),
        ),
        ("material={law='yeoh', parameters=[1e4, 0]}", ("material.parameters", "2 values", "yeoh")),
        (
            "material={law='yeoh', parameters=[1e4, nan, 0]}",
            ("material.parameters", "(10000.0, nan, 0.0)"),
        ),
        ("material={law='yeoh', parameters=[-1, 0, 0]}", ("shear modulus", "-2 Pa", "above 0 Pa")),
        (
            "material={law='mooney_rivlin', parameters=[1e4, -2e4]}",
            ("shear modulus", "-20000 Pa", "above 0 Pa"),
        ),
        (
            "material={law='ogden', parameters=[1e4, 2, 3]}",
            ("3 values", "ogden", "parameters = [mu1 [Pa], alpha1"),
        ),
        ("material={law='ogden', parameters=[1e4, 0]}", ("material.parameters", "[10000.0, 0.0]", "alpha")),
        ("region=[{set='all', law='ogden'}]", ("region.0.parameters", "0 values", "ogden")),
        (
            "region=[{set='all', parameters=[1.0]}]",
            ("region.0.parameters", "[1.0]", "neo_hooke", "young", "poisson"),
        ),
    ],
)
def test_what_a_law_does_not_take_is_refused(words: str, named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named) as refused:
        load_scene(SHARP, [words])
    assert "\n" not in str(refused.value)


def test_a_region_may_be_of_another_law() -> None:
    words = ["mesh.level=1", "set=[{name='half', along=[1,0,0], beyond=0.0}]"]
    region = made_of("ogden").removeprefix("material=").replace(", mass=0.032", ", set='half'")
    simulation = Simulation(load_scene(SHARP, [*words, f"region=[{region}]"]))
    simulation.step()
    assert np.isfinite(simulation.energies().strain)


def test_an_unknown_law_raises_compiled_or_not() -> None:
    with raises_naming(SceneError, "material.law", "'rubber'", "corotational, mooney_rivlin, neo_hooke"):
        law_named("rubber")
    mesh, none = brick("h8", (np.linspace(0, 1, 2),) * 3), no_solid().law
    solid = Solid(
        mesh.nodes, np.array(mesh.elements), mesh.kind, "neo_hooke", law_vector("neo_hooke", 1.0, 1.0)
    )
    x, modes, lost = np.array(mesh.nodes), solid.rest_modes(), solid.solid._replace(law=none)
    with raises_naming(ValueError, "elastic law"):
        solid_gradient(x, modes, lost, ELASTIC, *np.zeros((2, *x.shape)))
    with raises_naming(ValueError, "elastic law"):
        calls.tangent(none, np.eye(3), lost.p, False, np.zeros((9, 9)))
