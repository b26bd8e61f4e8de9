"""A scene is written out once: its short forms and the long ones become the same model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.messages import assert_names
from tests.scenes import SHARP
from tripod_sim import SceneError, load_scene
from tripod_sim.bodies.soft_build import assembled
from tripod_sim.effects.inertia import Inertia
from tripod_sim.mesh.described import described_mesh
from tripod_sim.model import ErrorEstimate
from tripod_sim.scene import Scene
from tripod_sim.scene.file import scene_names
from tripod_sim.scene.lowering import lowered
from tripod_sim.steps.contact import placed_bodies
from tripod_sim.tables.bodies import Body, Material, Mesh, Obstacle, Rigid, Tie
from tripod_sim.tables.contact import Contact
from tripod_sim.tables.sets import NodeSet

BALL = ("gravity={}", "ball={radius=0.01, mass=0.02, friction=0.2, restitution=0.1, position=[0, 0, 0.1]}")
FREE = ("silicone_free", "mesh.level=1")


def of_one_body(scene: Scene) -> Scene:
    """Return a scene whose short form is written as a body."""
    own: dict[str, Any] = {
        name: getattr(scene, name) for name in ("mesh", "material", "region", "servos", "effector")
    }
    short: dict[str, Any] = dict.fromkeys(("mesh", "material", "servos", "effector")) | {"region": ()}
    return replace(scene, **short, body=(Body("body", **own), *scene.body))


def test_the_short_form_of_a_body_is_that_body() -> None:
    short = load_scene("tripod", ["clamp=off", "mesh.level=1"])
    one, other = lowered(short), lowered(of_one_body(short))
    assert one.bodies[0][0] == ""
    assert other.bodies[0][0] == "body.0."
    assert replace(other.bodies[0][1], servos=None, effector=None) == one.bodies[0][1]
    assert [field for field, *_ in one.discs] == ["effector"]
    assert [field for field, *_ in other.discs] == ["body.0.effector"]
    assert one.joints and other.joints
    np.testing.assert_array_equal(one.joints.start, other.joints.start)
    for mine, theirs in zip(one.joints.arms, other.joints.arms, strict=True):
        assert mine.held == theirs.held
        for name in ("hub", "axis", "inward"):
            np.testing.assert_allclose(getattr(mine, name), getattr(theirs, name), atol=1e-15)
    assert one.posed and other.posed
    assert not lowered(load_scene(*FREE[:1], FREE[1:])).posed


def test_a_body_like_another_has_its_mesh_and_material() -> None:
    scene = load_scene(
        "silicone_free", ["mesh.level=1", 'body=[{name="twin", like="body", position=[0, 0, 0.1]}]']
    )
    (first, one), (second, two) = lowered(scene).bodies
    assert (first, second) == ("", "body.0.")
    assert two.mesh == one.mesh == Mesh(level=1)
    assert two.material == one.material


def test_a_ball_without_a_maze_is_a_rigid_body_in_contact() -> None:
    model = lowered(load_scene(FREE[0], [FREE[1], *BALL]))
    assert model.rigid == (("ball", Rigid(shape="ball", radius=0.01, mass=0.02, position=(0.0, 0.0, 0.1))),)
    assert model.contact and model.jumps
    assert (model.contact.friction, model.contact.restitution) == (0.2, 0.1)
    assert model.contact.contact_distance == pytest.approx(0.01 / 16)
    assert model.ball is None
    maze = lowered(load_scene("maze"))
    assert maze.rigid == () and maze.contact is None and not maze.jumps
    assert maze.ball == load_scene("maze").ball


@pytest.mark.parametrize(
    ("scene", "words", "found"),
    [
        (SHARP, (), None),
        (SHARP, ("time_error={}",), ErrorEstimate.CARRIED),
        ("pendulum", ("time_error={}",), ErrorEstimate.HALF_STEPS),
        ("stack", ("time_error={}",), ErrorEstimate.HALF_STEPS),
        ("stack", ("dt=auto",), ErrorEstimate.OVER_PATH),
        (SHARP, ("dt=auto", "time_error.accuracy=0.05"), ErrorEstimate.OVER_PATH),
    ],
)
def test_how_the_error_of_steps_is_found(
    scene: str, words: tuple[str, ...], found: ErrorEstimate | None
) -> None:
    model = lowered(load_scene(scene, words))
    assert model.estimate is found
    assert (model.time_error is None) == (found is None)
    assert (model.carried is None) == (found is not ErrorEstimate.CARRIED)


def test_an_open_scheme_is_chosen_with_the_steps_over_the_path() -> None:
    words = ["mesh.level=1", "dt=auto", "inertia.scheme=auto", "time_error.accuracy=0.05"]
    model = lowered(load_scene(SHARP, words))
    assert model.scheme and not model.scheme.is_automatic and model.scheme.name == "tr_bdf2"
    touching = lowered(load_scene("stack", words[1:]))
    assert touching.scheme and touching.scheme.name == "bdf2"
    assert lowered(load_scene(SHARP, ["inertia.scheme=auto"])).scheme != model.scheme


@pytest.mark.parametrize("name", scene_names())
def test_each_shipped_scene_says_in_its_model_what_moves_it(name: str) -> None:
    scene = load_scene(name)
    model = lowered(scene)
    assert len(model.effects) >= len(scene.effects)
    assert (model.scheme is None) == (scene.inertia is None)
    assert (model.gravity is None) == (scene.gravity is None)
    assert model.drag == (scene.damping.mass if scene.damping else 0.0)
    assert model.dt == scene.dt and model.solver == scene.solver


def test_a_body_that_is_tied_to_a_held_one_is_not_lifted() -> None:
    """Two blocks that are tied begin in the floor; where the second one is held neither may be moved."""
    corners = tuple(
        (x, y, z) for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    )
    mesh = Mesh("block", scale=0.01, element="h8", corners=corners)
    bodies = tuple(
        Body(name, (x, 0.0, -0.001), mesh=mesh, material=Material())
        for name, x in (("left", 0.0), ("right", 0.01))
    )
    sets = tuple(
        NodeSet(f"end of {body.name}", body=body.name, along=(1.0, 0.0, 0.0), at=0.01) for body in bodies
    )
    scene = Scene(
        "two", body=bodies, set=sets, tie=(Tie(sets[1].name, sets[0].name),), inertia=Inertia(),
        contact=Contact(start="lift"),
        obstacles=(Obstacle(shape="box", size=(1.0, 1.0, 0.2), position=(0.0, 0.0, -0.1)),),
    )  # fmt: skip
    model = lowered(scene)
    assembly, _ = assembled(model, described_mesh)
    assert model.contact
    none = np.zeros(0, dtype=np.int64)
    lifted = placed_bodies(assembly, none, model, model.contact)
    assert (lifted.nodes[:, 2] > assembly.nodes[:, 2]).all()
    with pytest.raises(SceneError) as error:
        placed_bodies(assembly, assembly.bodies[1].nodes[-1:], model, model.contact)
    assert_names(error.value, "contact.start", "'lift'", "'right'", "held")
