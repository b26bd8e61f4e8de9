"""Scenes of several soft bodies: what each does to the others, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.scenes import SHARP
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import SceneError
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.scene.file import scene_from_toml, scene_to_toml
from tripod_sim.tables.bodies import Tie

STATIC = ("inertia=off", "damping=off", "gravity=off")

BLOCK = """
name = "bar"
[mesh]
source = "block"
corners = [[0, 0, 0], [0.04, 0, 0], [0.04, 0.01, 0], [0, 0.01, 0],
           [0, 0, 0.01], [0.04, 0, 0.01], [0.04, 0.01, 0.01], [0, 0.01, 0.01]]
cells = [4, 1, 1]
[material]
young = 1e5
poisson = 0.0
density = 1000.0
[[set]]
name = "end"
along = [1, 0, 0]
at = 0.04
[[load]]
set = "end"
force = [1e-4, 0, 0]
[[fixed]]
low = [0, 0, 0]
high = [0, 0.01, 0.01]
[solver]
tolerance = 1e-9
"""


def pressed(simulation: Simulation) -> np.ndarray:
    """Sum of the contact forces on each soft body [N], shape (b, 3)."""
    world = integrator_of(simulation._stepper).world
    parts = world.surfaces.body[: len(world.forces())]
    return np.array([world.forces()[parts == k].sum(axis=0) for k in range(world.soft)])


def assert_nothing_passes(simulation: Simulation) -> None:
    """No edge of a soft body reaches through a triangle of another."""
    world = integrator_of(simulation._stepper).world
    x, s = world.positions_now(), world.surfaces
    for k in range(world.soft):
        for j in range(world.soft):
            if k == j:
                continue
            edges = s.edges[s.body[s.edges[:, 0]] == k]
            triangles = s.triangles[s.body[s.triangles[:, 0]] == j]
            a, b = x[edges[:, 0]][:, None], x[edges[:, 1]][:, None]
            p, q, r = (x[triangles[:, c]][None] for c in range(3))
            n = np.cross(q - p, r - p)
            da, db = ((a - p) * n).sum(-1), ((b - p) * n).sum(-1)
            inside = da * db < 0
            h = a + np.divide(da, da - db, out=np.zeros_like(da), where=inside)[..., None] * (b - a)
            for u, v in ((p, q), (q, r), (r, p)):
                inside &= (np.cross(v - u, h - u) * n).sum(-1) >= 0
            assert not inside.any()


def test_a_cable_bends_a_finger_as_beam_theory_says() -> None:
    """A cable of stiffness k L_0 = EA_c at distance e from the axis of a beam, rest length 1 - s: with

        T = s EA_c / (1 + EA_c (1 / EA + e² / EI)),   curvature T e / EI,

    the tip stands (1 - cos(curvature L)) / curvature to the side of the cable.
    """
    words = (*STATIC, "body.0.material.poisson=0.0", "body.1.springs.rest=0.99", "solver.tolerance=1e-7")
    simulation = Simulation(load_scene("finger", words))
    simulation.step()
    stretch, bend, e, cable = 250e3 * 2e-4, 250e3 * 0.02 * 0.01**3 / 12, 0.005, 10.0
    curvature = 0.01 * cable / (1 + cable * (1 / stretch + e * e / bend)) * e / bend
    tip = simulation.mesh.nodes[:, 2] < -0.1 + 1e-9
    move = (simulation.positions - simulation.mesh.nodes)[tip].mean(axis=0)
    assert move[0] == pytest.approx((1 - np.cos(0.1 * curvature)) / curvature, rel=0.015)
    assert abs(move[1]) < 1e-6


def test_tied_nodes_are_one() -> None:
    simulation = Simulation(load_scene("finger"))
    finger, cable = simulation.mesh.bodies  # type: ignore[union-attr]
    assert np.isin(cable.nodes, finger.nodes).all()
    assert len(simulation.positions) == len(finger.nodes) == 189
    assert simulation.bodies == (189, 12 * 21)
    assert len(simulation.shown(simulation.positions)) == sum(simulation.bodies)


def test_two_blocks_that_are_tied_are_one_block() -> None:
    whole = Simulation(scene_from_toml(BLOCK))
    half = BLOCK.replace("0.04, 0", "0.02, 0").replace("cells = [4", "cells = [2")
    second = """
[[body]]
name = "second"
position = [0.02, 0.0, 0.0]
[body.mesh]
source = "block"
corners = [[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0],
           [0, 0, 0.01], [0.02, 0, 0.01], [0.02, 0.01, 0.01], [0, 0.01, 0.01]]
cells = [2, 1, 1]
[body.material]
young = 1e5
poisson = 0.0
density = 1000.0
[[set]]
name = "face"
body = "second"
low = [0, 0, 0]
high = [0.02, 0.01, 0.01]
[[tie]]
set = "face"
to = "body"
"""
    two = Simulation(scene_from_toml(half + second))
    for simulation in (whole, two):
        simulation.step()
    assert len(two.positions) == len(whole.positions)
    assert whole._mass.sum() == pytest.approx(two._mass.sum(), rel=1e-12) == pytest.approx(0.004)
    order = [np.lexsort(np.round(s.mesh.nodes, 9).T) for s in (whole, two)]
    np.testing.assert_allclose(two.positions[order[1]], whole.positions[order[0]], rtol=0, atol=1e-10)
    assert (whole.positions - whole.mesh.nodes).max() > 3e-7


def test_two_materials_in_one_body_give_way_one_after_the_other() -> None:
    """F / A (L_1 / E_1 + L_2 / E_2), and the mass of each half."""
    region = """
[[set]]
name = "stiff"
along = [1, 0, 0]
beyond = 0.02
[[region]]
set = "stiff"
young = 4e5
poisson = 0.0
density = 3000.0
"""
    simulation = Simulation(scene_from_toml(BLOCK + region))
    simulation.step()
    end = simulation.mesh.nodes[:, 0] > 0.04 - 1e-9
    stretch = (simulation.positions - simulation.mesh.nodes)[end, 0].mean()
    assert stretch == pytest.approx(1e-4 / 1e-4 * (0.02 / 1e5 + 0.02 / 4e5), rel=1e-4)
    assert simulation._mass.sum() == pytest.approx(1e-4 * (0.02 * 1000 + 0.02 * 3000))
    assert len(simulation._system.elastic.terms) == 2  # type: ignore[union-attr]


def test_a_body_of_the_long_form_is_that_of_the_short_one() -> None:
    short = load_scene("silicone_free", ["mesh.level=1"])
    text = scene_to_toml(short)
    for name in ("mesh", "material"):
        text = text.replace(f"[{name}]", f"[body.{name}]")
    text = text.replace("[body.mesh]", '[[body]]\nname = "piece"\n[body.mesh]')
    found = [Simulation(s) for s in (short, scene_from_toml(text))]
    for _ in range(10):
        for simulation in found:
            simulation.step()
    np.testing.assert_array_equal(found[0].positions, found[1].positions)


def test_a_body_that_is_turned_moves_in_its_turned_frame() -> None:
    """The finger and its cable, both turned about the origin with the box that holds them: the same shape, turned."""
    scene = load_scene("finger", [*STATIC, "solver.tolerance=1e-7"])
    half = np.sqrt(0.5)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter about Z
    finger = replace(scene.body[0], orientation=(0.0, 0.0, half, half))
    cable = replace(scene.body[1], orientation=(-0.5, 0.5, 0.5, 0.5), position=(0.0, 0.005, 0.0))
    fixed = replace(scene.fixed[0], low=(-0.01, -0.005, 0.0), high=(0.01, 0.005, 0.0))
    turned = Simulation(replace(scene, body=(finger, cable), fixed=(fixed,)))
    plain = Simulation(scene)
    for simulation in (plain, turned):
        simulation.step()
    assert np.abs(plain.positions - plain.mesh.nodes).max() > 5e-3
    np.testing.assert_allclose(turned.positions, plain.positions @ turn.T, atol=1e-8)


def test_a_cloth_lies_on_another() -> None:
    """Nothing passes, and at rest each carries what lies on it."""
    simulation = Simulation(load_scene("two_cloths", ["body.0.springs.nodes=6", "body.1.springs.nodes=5"]))
    for k in range(60):
        simulation.step()
        if k % 6 == 0:
            assert_nothing_passes(simulation)
    lower, upper = pressed(simulation)
    weights = 9.81 * 0.0002 * np.array([36, 25])
    assert upper[2] == pytest.approx(weights[1], rel=0.03)
    assert lower[2] == pytest.approx(weights[0], rel=0.03)
    x = simulation.positions
    assert x[36:, 2].max() > x[:36, 2].max() > 0.05


def test_the_tripod_takes_a_cloth_along() -> None:
    simulation = Simulation(load_scene("tripod_cloth", ["body.0.springs.nodes=5"]))
    count = simulation.bodies[0]

    def heights() -> np.ndarray:
        assert simulation.effector
        return np.array([simulation.positions[count:, 2].mean(), simulation.effector.position[2]])

    for _ in range(60):
        simulation.step()
    before = heights()
    assert pressed(simulation)[1, 2] == pytest.approx(25 * 2e-5 * 9.81, rel=0.05)
    assert_nothing_passes(simulation)
    compliance = simulation.compliance()
    alone = Simulation(load_scene(SHARP, ["mesh.level=1", "solver.mode=newton"])).compliance()
    assert compliance.w[2, 2] == pytest.approx(alone.w[2, 2], rel=0.02)  # it lies there, and holds nothing
    for k in range(40):
        angle = -0.4 * (k + 1) / 40
        simulation.step(np.array([angle, angle, angle, 0.0]))
    assert_nothing_passes(simulation)
    rise = heights() - before
    assert rise[1] > 2e-3
    assert rise[0] == pytest.approx(rise[1], rel=0.5)


def test_a_ball_lies_on_a_cloth_on_a_block() -> None:
    simulation = Simulation(load_scene("pile", ["body.1.springs.nodes=5"]))
    forces = []
    for _ in range(60):
        simulation.step()
        forces.append(pressed(simulation))
    assert_nothing_passes(simulation)
    block, cloth = np.mean(
        forces[-40:], axis=0
    )  # the ball rolls, so that each by itself swings by some per cent
    ball = 0.02 * 9.81
    assert cloth[2] == pytest.approx(25 * 2e-5 * 9.81, abs=0.02 * ball)  # what it bears it hands on
    assert block[2] == pytest.approx(1070 * 0.04 * 0.04 * 0.03 * 9.81, rel=0.02)
    lowest = simulation.rigid[0].position[2] - 0.01
    assert 0.028 < lowest < 0.034  # on the cloth, a little into the block


def test_bodies_apart_move_as_each_alone() -> None:
    """A solid and a net that never meet: each as in a scene of its own."""
    net = """
[[body]]
name = "net"
position = [0.0, 0.0, 1.0]
[body.springs]
nodes = 4
size = 0.1
stiffness = 50.0
"""
    solid = scene_to_toml(load_scene("silicone_free", ["mesh.level=1", "solver.tolerance=1e-9"]))
    both = Simulation(scene_from_toml(solid + net))
    alone = Simulation(scene_from_toml(solid))
    for _ in range(10):
        both.step()
        alone.step()
    n = len(alone.positions)
    np.testing.assert_allclose(both.positions[:n], alone.positions, rtol=0, atol=1e-9)
    fall = 0.5 * 9.81 * 0.05**2
    np.testing.assert_allclose(
        1.0 - both.positions[n:, 2], fall * 1.1, rtol=1e-6
    )  # implicit Euler: (N + 1) / N


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["body.1.position=[0.007, 0.0, 0.0]"], ("tie.0", "21 of 21", "'cable'", "'finger'", "2 mm")),
        (["tie.0.to=fingr"], ("tie.0.to is 'fingr'", "'finger'")),
        (["tie.0.to=cable"], ("tie.0", "nodes", "'cable'", "same body")),
        (["body.1.name=finger"], ("body.1.name is 'finger'", "must differ")),
        (["body.1.springs.source=chian"], ("body.1.springs.source is 'chian'",)),
        (["body.0.mesh.source=nothing"], ("body.0.mesh.source is 'nothing'",)),
        (["body.0.orientation=[0, 0, 0, 0.5]"], ("body.0.orientation", "0.5", "unit quaternion")),
        (["body.0.mesh.cells=[2, 2, 10]"], ("tie.0", "10 of 21", "'cable'", "'finger'", "5 mm")),
        (["body.0.mesh.cells=[2, 2, 10]", "tie.0.within=0.006"], ("ties", "into one", "body 'cable'")),
        (["body.0.material.young=-1"], ("body.0.material.young is -1.0", "above 0 Pa")),
        (["servos={}"], ("servo_0",)),
        (["body.0.springs={}"], ("body.0.mesh", "body.0.springs", "exclude")),
        (["body.0.mesh=off"], ("setting body.0.mesh=off", "effect")),
        (['body.0.region=[{set="cable"}]'], ("body.0.region.0.set is 'cable'", "no element")),
    ],
)
def test_bad_bodies_are_told_in_one_line(words: list[str], named: tuple[str, ...]) -> None:
    with raises_naming(SceneError, *named) as error:
        Simulation(load_scene("finger", words))
    assert "\n" not in str(error.value)


def test_bodies_that_begin_in_each_other_are_named_or_lifted() -> None:
    words = ["body.1.position=[0.004, 0.003, 0.055]", "body.1.orientation=[0.01, 0.0, 0.0, 0.99995]"]
    with raises_naming(SceneError, "body 'upper'", "body 'lower'", "start", "contact.start"):
        Simulation(load_scene("two_cloths", words))
    lifted = Simulation(load_scene("two_cloths", [*words, "contact.start=lift"]))
    assert_nothing_passes(lifted)
    assert lifted.positions[64:, 2].min() > 0.055


def test_each_node_of_a_tie_is_tied_also_where_several_have_the_same_partner() -> None:
    """A cable of 41 nodes before a finger that has 21 along it: to tie all is to make one of several of the cable."""
    first, second = load_scene("finger", ["body.1.springs.nodes=41"]).body[::-1]
    scene = replace(load_scene("finger"), body=(first, second), tie=(Tie("cable", "finger", 0.003),))
    with raises_naming(SceneError, "ties", "body 'cable'"):
        Simulation(scene)


def test_without_contact_two_cloths_fall_through_each_other() -> None:
    """What the tests above show is contact's doing."""
    scene = load_scene(
        "two_cloths", ["contact=off", "obstacles=off", "body.0.springs.fixed_corners=[0, 1, 2, 3]"]
    )
    simulation = Simulation(scene)
    for _ in range(40):
        simulation.step()
    x = simulation.positions
    assert x[64:, 2].max() < x[:64, 2].min()
