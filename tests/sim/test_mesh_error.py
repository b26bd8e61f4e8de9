"""The live estimate of the mesh's error at the effector, against the same scene on a finer mesh."""

import re

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import CUBE, SHARP
from tests.tiers import sampled
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.effects.inertia import Inertia
from tripod_sim.effects.strain_limit import StrainLimit
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.mesh.block import block
from tripod_sim.mesh.convert import convert
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.mesh_error import estimate
from tripod_sim.mesh_error.estimate import finer, richer
from tripod_sim.mesh_error.external_loads import ExternalLoads, alone, interpolation
from tripod_sim.mesh_error.support import Support
from tripod_sim.scene.lowering import lowered
from tripod_sim.tables.bodies import Mesh
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.sets import Fixed, Load
from tripod_study.recording import Recording
from tripod_study.summary.errors import effector_error

W = -1.4965
CLAMP = "clamp.stiffness=1.4e10"
ALWAYS = "mesh_error.share=1e6"
WORKING = (f"servos.angles=[{W},{W},{W}]", "servos.slide=0.035")
"""The estimate after each step."""


def effector(words: tuple[str, ...], way: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the effector along a way, and its estimated errors [m], NaN without."""
    simulation = Simulation(load_scene(SHARP, [CLAMP, "solver.max_turn=0.3", *words]))
    places, errors = [], []
    for joints in way:
        report = simulation.step(joints)
        places.append(simulation.state.centres[0].copy())
        errors.append(report.mesh_error.effector if report.mesh_error else (np.nan,) * 3)
    return np.array(places), np.array(errors)


def test_poses_err_as_estimated_by_every_mesh() -> None:
    """The reference of the finer one is finer than what estimates its error."""
    still = ("inertia=off", "damping=off")
    way = [np.array([W / 2, W / 2, W / 2, 0.017]), np.array([-1.2, -1.6, W, 0.035])]
    true, _ = effector((*still, "mesh.element=h20", "mesh.level=9"), way)
    for words in (
        ("mesh.level=1",),
        ("mesh.level=2",),
        ("mesh.level=8",),
        ("mesh.element=h20", "mesh.level=2"),
    ):
        found, estimated = effector((*still, ALWAYS, *words), way)
        lengths = np.linalg.norm(true - found, axis=1)
        assert (lengths > 1e-4).all(), "there is an error to find"
        left = np.linalg.norm(true - found - estimated, axis=1)
        assert (left < 0.5 * lengths).all(), (words, left / lengths)


STILL = ("inertia=off", "damping=off")
TURNED = [np.array([W / 2, W / 2, W / 2, 0.017]), np.array([-1.2, -1.6, W, 0.035])]


@pytest.fixture(scope="module")
def true_poses() -> np.ndarray:
    """Where the effector is in `TURNED` on a mesh that is finer than what estimates the errors of others."""
    return effector((*STILL, "mesh.element=h20", "mesh.level=9"), TURNED)[0]


@pytest.mark.parametrize("element", ELEMENTS)
def test_poses_err_as_estimated_of_every_element(element: str, true_poses: np.ndarray) -> None:
    found, estimated = effector((*STILL, ALWAYS, f"mesh.element={element}", "mesh.level=2"), TURNED)
    lengths = np.linalg.norm(true_poses - found, axis=1)
    assert (lengths > 1e-4).all(), "there is an error to find"
    left = np.linalg.norm(true_poses - found - estimated, axis=1)
    assert (left < 0.2 * lengths).all(), left / lengths


TOUCH = "contact={contact_distance=1e-4, alarm_distance=5e-4}"
SLOW = "damping.mass=20.0"
POST = f"{{{{source='{CUBE}', scale=0.06, position=[{{}}, 0.0, -0.0195]}}}}"
BESIDE = {
    "a ball": ("ball={mass=9e-4, radius=0.006, position=[0.012, 0.0, 0.0]}",),
    "a ball in a maze": ("maze={}", "ball={mass=5e-4}"),
    "a weight": (TOUCH, "rigid=[{shape='ball', radius=0.012, mass=0.05, position=[0, 0, 0.006]}]"),
    "a ball as a weight": (TOUCH, "ball={radius=0.012, mass=0.05, position=[0, 0, 0.006]}"),
    "a cloth": (
        TOUCH,
        "springs={source='grid', nodes=6, size=0.04, position=[-0.02, -0.02, -0.006], node_mass=1e-3, stiffness=200, "
        "shear=50}",
    ),
    "a taut cable, tied": (
        "springs={source='chain', nodes=4, size=0.03, position=[-0.015, 0.0, 0.01], node_mass=1e-3, stiffness=20, "
        "rest=0.8, fixed_nodes=[0]}",
        "set=[{name='end', body='springs', low=[0.008, -1, -1], high=[1, 1, 1]}, "
        "{name='disc', body='body', low=[0.0083, -0.001, 0.002], high=[0.009, 0.001, 0.003]}]",  # a node of all meshes
        "tie=[{set='end', to='disc', within=0.03}]",
    ),
    "an obstacle under a strip": (TOUCH, f"obstacles=[{POST.format(0.025)}]"),
}


@pytest.mark.parametrize("name", sampled(BESIDE, "a ball", "a weight", "an obstacle under a strip"))
def test_beside_other_things_the_effector_errs_as_estimated(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Effectivity 0.5 to 2; an estimate that knows nothing of what acts on the body is another one."""
    there, down = np.array([W, W, W, 0.035]), np.array([-0.15, -0.15, -0.15, 0.0])
    way = [there + (min(1.0, (k + 1) / 10) * down if "obstacle" in name else 0.0) for k in range(30)]
    words = (*WORKING, SLOW, *BESIDE[name])
    true, _ = effector((*words, "mesh.element=h20", "mesh.level=9", "solver.mode=newton"), way)
    found, estimated = effector((*words, ALWAYS), way)
    lengths, told = (np.linalg.norm(e, axis=1)[[15, -1]] for e in (true - found, estimated))
    assert (lengths > 1e-4).all(), "there is an error to find"
    assert ((told > 0.5 * lengths) & (told < 2.0 * lengths)).all(), told / lengths
    left = np.linalg.norm(true - found - estimated, axis=1)[[15, -1]]
    assert (left < 0.5 * lengths).all(), left / lengths
    monkeypatch.setattr(ExternalLoads, "load", lambda *_: None)
    _, without = effector((*words, ALWAYS), way)
    assert np.linalg.norm(estimated[-1] - without[-1]) > 0.01 * lengths[-1], "what acts on it counts"


def test_where_the_disc_leans_on_an_obstacle_the_mesh_makes_no_error() -> None:
    """Taken as a known force, what the obstacle presses with would leave 0.7 mm."""
    way = [
        np.array([W - 0.015 * min(k, 10), W - 0.015 * min(k, 10), W - 0.015 * min(k, 10), 0.035])
        for k in range(30)
    ]
    _, estimated = effector((*WORKING, SLOW, ALWAYS, TOUCH, f"obstacles=[{POST.format(0.006)}]"), way)
    assert np.linalg.norm(estimated[0]) > 6e-4
    assert np.linalg.norm(estimated[-1]) < 5e-5


def test_what_holds_the_body_is_no_force_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes that hold a strip of the coarse mesh lie in elements of the richer one that are not held altogether."""
    held = "fixed=[{low=[0.025, -0.02, -0.01], high=[0.033, 0.02, 0.01]}]"
    way = [np.array([0.0, -0.3, -0.3, 0.0])]
    words = (*STILL, ALWAYS, "mesh.level=1", held)
    _, told = effector(words, way)
    monkeypatch.setattr(ExternalLoads, "load", lambda *_: None)
    _, without = effector(words, way)
    assert np.linalg.norm(told) > 1e-4
    assert np.abs(told - without).max() < 1e-6  # [m], by forces within the tolerance


def test_beside_other_things_the_motion_is_the_same_to_the_bit_and_reset_begins_anew() -> None:
    words = (*WORKING, *BESIDE["a weight"])
    way = [np.array([W + 0.02 * k, W, W, 0.035]) for k in range(1, 11)]
    plain, _ = effector(words, way)
    watched, _ = effector((*words, ALWAYS), way)
    assert plain.tobytes() == watched.tobytes()
    simulation = Simulation(load_scene(SHARP, [CLAMP, *words, ALWAYS]))
    first = [simulation.step(joints).mesh_error for joints in way]
    simulation.reset()
    assert [simulation.step(joints).mesh_error for joints in way] == first


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (Mesh(element="t4", level=2), ("h20", 8, 0)),
        (Mesh(element="t4", level=8), ("h20", 8, 0)),
        (Mesh(element="h27", level=9), ("h20", 9, 1)),
        (Mesh(element="h20", level=13), ("h20", 13, 1)),
        (Mesh(element="h8_modes", level=13), ("h20", 13, 0)),
        (Mesh("block", element="t10"), ("h20", 2, 1)),
        (Mesh("piece.vtk", element="t4"), ("t10", 2, 0)),
        (Mesh("piece.vtk", element="t10"), ("t10", 2, 1)),
        (Mesh("piece.vtk", element="h27", refine=1), ("h27", 2, 2)),
        (Mesh("piece.vtk", element="h8_mean"), ("h20", 2, 0)),
    ],
)
def test_each_element_is_held_against_a_richer_one(mesh: Mesh, expected: tuple[str, int, int]) -> None:
    found = finer(mesh)
    assert (found.element, found.level, found.refine) == expected


def test_what_is_said_of_other_bodies_is_not_said_of_the_first_alone() -> None:
    words = (
        CLAMP, *BESIDE["a taut cable, tied"], "strain_limit={}", "mesh_error={}", "marker=[{set='end'}]",
        "fixed=[{set='end'}, {low=[0.04, -0.01, -0.01], high=[0.06, 0.01, 0.01]}]",
        "load=[{set='end', force=[0, 0, 0.1]}, {set='disc', force=[0, 0, 0.1]}]",
    )  # fmt: skip
    model = lowered(load_scene(SHARP, words))
    mesh = model.bodies[0][1].mesh
    assert mesh
    found = alone(model, mesh)
    assert [body.name for _, body in found.bodies] == ["body"]
    assert [table.name for table in found.sets] == ["disc"]
    effects = {effect.table: table for effect, table in found.effects}
    assert [table.set for table in effects[Load]] == ["disc"]
    assert [table.low for table in effects[Fixed]] == [(0.04, -0.01, -0.01)]
    assert not {Contact, StrainLimit, Inertia} & set(effects)
    assert not (found.ties or found.markers or found.contact or found.scheme)
    assert found.joints and found.joints.count == 3


def test_a_support_pulls_points_back_along_its_directions() -> None:
    rng = np.random.default_rng(5)
    nodes, weights = np.array([[0, 1, 2], [1, 2, 3], [0, 1, 2]]), rng.uniform(0, 1, (3, 3))
    support = Support(nodes, weights, 50.0)
    normal = np.array([0.6, 0.0, 0.8])
    x, dx, place = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), rng.normal(size=(2, 3))
    assert support.add_gradient(x, np.zeros((4, 3))) == 0.0
    support.hold(np.array([1, 2]), np.array([np.outer(normal, normal), np.eye(3)]), place)
    g, slope, h = np.zeros((4, 3)), np.zeros((4, 3)), 1e-6
    energy = support.add_gradient(x, g)
    miss = support.places(x)[1:] - place
    assert energy == pytest.approx(25.0 * ((miss[0] @ normal) ** 2 + miss[1] @ miss[1]))
    ends = [support.add_gradient(x + s * h * dx, np.zeros((4, 3))) for s in (1, -1)]
    assert np.vdot(g, dx) == pytest.approx((ends[0] - ends[1]) / (2 * h), rel=1e-6)
    support.add_products(dx, slope)
    further = np.zeros((4, 3))
    support.add_gradient(x + dx, further)
    np.testing.assert_allclose(slope, further - g, atol=1e-12)


def test_quadratic_elements_are_held_against_half_their_edges() -> None:
    scene = load_scene(SHARP, [CLAMP, "mesh.element=h20", "mesh.level=8", "mesh_error={}"])
    mesh = richer(lowered(scene)).bodies[0][1].mesh
    assert mesh
    assert (mesh.element, mesh.level, mesh.refine) == ("h20", 8, 1)
    fast = richer(lowered(load_scene(SHARP, [CLAMP, "mesh_error={}"]))).bodies[0][1].mesh
    assert fast
    assert (fast.element, fast.level, fast.refine) == ("h20", 8, 0)


def test_a_fast_motion_errs_as_estimated_with_its_inertia() -> None:
    way = [np.array([W + 0.3 * min(1, k / 6), W, W, 0.035]) for k in range(1, 31)]
    true, _ = effector((*WORKING, "mesh.element=h20", "mesh.level=8", "solver.mode=newton"), way)
    found, estimated = effector((*WORKING, ALWAYS), way)
    left = np.linalg.norm(true - found - estimated, axis=1)
    assert (left < 0.15 * np.linalg.norm(true - found, axis=1)).all()
    rest, held = effector((*WORKING, ALWAYS, "gravity=off"), way)
    assert np.isfinite(held).all() and np.isfinite(rest).all()


@pytest.mark.parametrize("damping", [(), ("damping=off",), ("damping.mass=20.0",)])
@pytest.mark.parametrize("scheme", sampled(["implicit_euler", "tr_bdf2"], "tr_bdf2"))
def test_a_fast_motion_is_told_no_error_by_its_own_mesh(
    scheme: str, damping: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What acts on the body is what its own mesh lacks for balance, whatever scheme and damping make of it."""
    way = [np.array([W + 0.3 * min(1, k / 6), W, W, 0.035]) for k in range(1, 31)]
    words = (*WORKING, ALWAYS, "mesh.element=h20", f"inertia.scheme={scheme}", *damping)
    _, richer_told = effector(words, way)
    monkeypatch.setattr(estimate, "finer", lambda mesh: mesh)
    _, told = effector(words, way)
    assert np.linalg.norm(richer_told, axis=1).min() > 1e-4
    assert np.linalg.norm(told, axis=1).max() < 1e-9


def test_the_default_share_tells_it_seldom_and_the_same_within_a_part() -> None:
    way = [np.array([W + 0.3 * np.sin(0.05 * k), W, W, 0.035]) for k in range(1, 101)]
    _, each = effector((*WORKING, ALWAYS), way)
    simulation = Simulation(load_scene(SHARP, [CLAMP, "solver.max_turn=0.3", *WORKING, "mesh_error={}"]))
    found = [report for joints in way if (report := simulation.step(joints).mesh_error)]
    assert 1 <= len({report.time for report in found}) < len(way)
    told = np.array([report.effector for report in found])
    assert np.linalg.norm(told - each, axis=1).max() < 0.5 * np.linalg.norm(each, axis=1).max()


def test_the_motion_is_the_same_to_the_bit_and_reset_begins_anew() -> None:
    way = [np.array([W + 0.02 * k, W, W, 0.035]) for k in range(1, 11)]
    plain, _ = effector(WORKING, way)
    watched, _ = effector((*WORKING, ALWAYS), way)
    assert plain.tobytes() == watched.tobytes()
    simulation = Simulation(load_scene(SHARP, [CLAMP, *WORKING, ALWAYS]))
    first = [simulation.step(joints).mesh_error for joints in way]
    simulation.reset()
    assert [simulation.step(joints).mesh_error for joints in way] == first


def test_a_restored_state_errs_as_it_did() -> None:
    simulation = Simulation(load_scene(SHARP, [CLAMP, *WORKING, ALWAYS]))
    there = np.array([W + 0.4, W, W - 0.2, 0.035])
    share = np.minimum(np.arange(1, 31) / 20, 1.0)[:, None]
    way = simulation.command + share * (there - simulation.command)
    for joints in way[:20]:
        simulation.step(joints)
    saved = simulation.save()
    went = [simulation.step(joints).mesh_error for joints in way[20:]]
    simulation.reset()
    told = []
    for _ in range(2):
        simulation.restore(saved)
        told.append([simulation.report.mesh_error])
        told[-1] += [simulation.step(joints).mesh_error for joints in way[20:]]
    assert told[0] == told[1]
    before, after = (
        np.array([report.effector for report in found if report]) for found in (went, told[0][1:])
    )
    assert np.linalg.norm(after - before, axis=1).max() < 0.1 * np.linalg.norm(before, axis=1).max()


def test_of_two_equilibria_it_takes_that_of_the_body() -> None:
    """Driven there by itself the richer mesh snaps to one that is 4.5 mm lower."""
    words = ("mesh.element=h8_modes", "mesh.level=8", "servos.angles=[-0.399, -0.233, -0.207]", "servos.slide=0.00906",
             "gravity.acceleration=[-2.43, 1.13, -11.06]")  # fmt: skip
    told = Simulation(load_scene("tripod", [*STILL, *words, ALWAYS])).report.mesh_error
    own, other = (
        Simulation(load_scene("tripod", [*STILL, *words, *mesh])).state.centres[0]
        for mesh in ((), ("mesh.element=h20",))
    )
    assert np.linalg.norm(other - own) > 4e-3
    assert told and 1e-5 < told.distance < 1e-3


@pytest.mark.slow
def test_the_shipped_scene_errs_in_motion_as_estimated_of_mesh_and_steps() -> None:
    scene = load_scene("tripod", WORKING)
    finer_words = ("mesh.level=9", f"dt={scene.dt / 4}", "solver.mode=newton", "solver.tolerance=1e-6")
    own, true = (
        Simulation(load_scene("tripod", [*WORKING, *words]))
        for words in (("mesh_error={}", "time_error={}"), finer_words)
    )
    misses, told, mesh = [], [], []
    for k in range(1, 31):
        report = own.step([W + 0.2 * min(1, k / 15), W, W, 0.035])
        for part in range(4 * k - 3, 4 * k + 1):
            true.step([W + 0.2 * min(1, part / 60), W, W, 0.035])
        misses.append(np.linalg.norm(true.state.centres[0] - own.state.centres[0]))
        told.append(effector_error(report))
        mesh.append(report.mesh_error.distance if report.mesh_error else np.nan)
    assert max(misses) > 2e-5, "there is an error to find"
    assert 0.5 * max(misses) < max(told) < 2 * max(misses)
    assert 0.0 < max(mesh) < max(told)


def test_a_pose_of_the_shipped_mesh_is_told_to_a_micrometre() -> None:
    """It errs by less than a fiftieth of a millimetre there."""
    joints = np.array([-0.25, -0.25, -0.25, 0.00585])
    own, finer_one = (
        Simulation(load_scene("tripod", [*STILL, "solver.max_turn=0.3", "solver.tolerance=1e-6", *words]))
        for words in ((ALWAYS,), ("mesh.level=9",))
    )
    report = own.step(joints)
    finer_one.step(joints)
    assert report.mesh_error
    error = finer_one.state.centres[0] - own.state.centres[0]
    np.testing.assert_allclose(report.mesh_error.effector, error, atol=1e-6)


def test_after_a_long_way_in_one_step_it_finds_its_rest_again() -> None:
    still = (CLAMP, "inertia=off", "damping=off", "mesh_error.share=1e-9")
    simulation = Simulation(load_scene(SHARP, [*WORKING, *still]))
    simulation.step(np.zeros(4))
    found = simulation.mesh_error()
    fresh = Simulation(load_scene(SHARP, still)).mesh_error()
    assert found and fresh
    np.testing.assert_allclose(found.effector, fresh.effector, atol=2e-5)
    assert fresh.distance > 1e-4


def test_values_go_to_other_nodes_by_the_elements_they_lie_in() -> None:
    size = ((0, 0), (0.03, 0), (0.033, 0.02), (0, 0.02))
    mesh = block(tuple((x, y, z) for z in (0.0, 0.01) for x, y in size), (3, 2, 1))
    rng = np.random.default_rng(3)
    points = rng.uniform(0, 1, (50, 3)) * (0.03, 0.02, 0.01)
    nodes, weights = interpolation(mesh, points)
    values = mesh.nodes @ np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1]]) + 0.5
    expected = points @ np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1]]) + 0.5
    np.testing.assert_allclose(np.einsum("pa,pai->pi", weights, values[nodes]), expected, atol=1e-12)


@pytest.mark.parametrize("element", ["t4", "t10"])
def test_values_go_to_other_nodes_by_tetrahedra_too(element: str) -> None:
    size = ((0, 0), (0.03, 0), (0.03, 0.02), (0, 0.02))
    mesh = block(tuple((x, y, z) for z in (0.0, 0.01) for x, y in size), (3, 2, 1))
    mesh = convert(mesh, element)
    points = np.random.default_rng(3).uniform(0, 1, (50, 3)) * (0.03, 0.02, 0.01)
    nodes, weights = interpolation(mesh, points)
    slopes = np.array([[1.0, 2, 0], [0, 1, 3], [2, 0, 1]])
    np.testing.assert_allclose(
        np.einsum("pa,pai->pi", weights, (mesh.nodes @ slopes)[nodes]), points @ slopes, atol=1e-12
    )
    assert weights.min() > (-1e-9 if element == "t4" else -0.2), "the points lie in the elements"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["mesh_error={}"], ("mesh_error needs clamp", "ideal clamp", "singular")),
        ([CLAMP, "mesh_error={}", "effector=off"], ("mesh_error needs effector",)),
        (["clamp={}", "mesh_error={}"], ("clamp.stiffness", "1.2 mm", "at most ")),
        (
            [CLAMP, "mesh_error={}", "force=[{name='push', set='all', direction=[1,0,0], range=[0,1]}]"],
            ("mesh_error", "force", "cannot be combined"),
        ),
        ([CLAMP, "material.young=1e5", "mesh_error={}"], ("clamp.stiffness is 1.4e+10 N/m⁴",)),
        (
            [
                CLAMP,
                "mesh_error={}",
                "platform=[{hold=[{set='all', point=[0,0,0], to=[0,0,0]}], position=[0,0,0]}]",
            ],
            ("mesh_error", "platform", "cannot be combined"),
        ),
    ],
)
def test_what_has_no_estimate_is_refused(words: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named):
        load_scene(SHARP, words)


def test_the_stiffness_that_a_refusal_names_is_accepted() -> None:
    with pytest.raises(SceneError) as refused:
        load_scene(SHARP, ["clamp={}", "mesh_error={}"])
    most = re.search(r"at most ([\d.e+]+)", str(refused.value))
    assert most
    load_scene(SHARP, [f"clamp.stiffness={most[1]}", "mesh_error={}"])


def test_each_node_errs_as_estimated_and_the_steps_stay_the_same() -> None:
    """Against the same pose on quadratic elements of half the size: nodes in the strips, of which most err."""
    words = [CLAMP, "solver.max_turn=0.3", *STILL]
    body = Simulation(load_scene(SHARP, [*words, ALWAYS]))
    unseen = Simulation(load_scene(SHARP, [*words, ALWAYS]))
    true = Simulation(load_scene(SHARP, [*words, "mesh.element=h20", "mesh.level=9"]))
    for joints in TURNED:
        for simulation in (body, unseen, true):
            simulation.step(joints)
        body.mesh_error_field()
    np.testing.assert_array_equal(body.positions, unseen.positions)
    assert body.report.mesh_error == unseen.report.mesh_error
    found = body.mesh_error_field()
    assert found is not None and found.shape == (len(body.skin.nodes),)
    assert isinstance(true.mesh, SolidMesh)
    nodes, weights = interpolation(true.mesh, body.mesh.nodes)
    apart = np.einsum("pa,pai->pi", weights, (true.positions - true.mesh.nodes)[nodes])
    error = np.linalg.norm(apart - (body.positions - body.mesh.nodes), axis=1)
    large = error > 0.2 * error.max()
    assert large.mean() > 0.2
    share = found / error
    assert (np.abs(np.log2(share[large])) < 1).all(), (share[large].min(), share[large].max())


def test_a_body_that_the_richer_mesh_changes_nothing_of_has_no_error() -> None:
    """Without weight, at rest undeformed."""
    words = [CLAMP, "gravity=off", *STILL, ALWAYS]
    body = Simulation(load_scene(SHARP, words))
    body.step()
    found = body.mesh_error_field()
    assert found is not None
    np.testing.assert_allclose(found, 0.0, atol=1e-9)  # [m]


def test_the_field_is_unknown_where_forces_are_applied_and_absent_without_an_estimate() -> None:
    body = Simulation(load_scene(SHARP, [CLAMP, ALWAYS]))
    body.apply_forces({0: np.array([0.0, 0.0, 1e-3])})
    body.step()
    found = body.mesh_error_field()
    assert found is not None and np.isnan(found).all()
    plain = Simulation(load_scene(SHARP))
    assert plain.mesh_error_field() is None
    with raises_naming(SceneError, "mesh_error", "[mesh_error]"):
        Recording(plain, 1, mesh_error=True)
    with raises_naming(SceneError, "mesh_error", "Simulation.mesh_error_field"):
        body.fields().values(["mesh_error"], body.positions)
