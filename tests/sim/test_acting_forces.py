"""The forces on the bodies, as they are shown: balance at rest, contacts, cables, servos, loads; nothing unasked."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.messages import raises_naming
from tests.sim.actuator_scenes import BY_LENGTH, BY_TENSION, JAW, PUSH, finger
from tripod_host.arrays import FloatArray
from tripod_sim import SceneError, Simulation, acting_forces, load_scene
from tripod_sim.acting_forces import ON, UNITS, Forces, kind_of

G = 9.81
STILL = ("inertia=off", "damping=off")
FORCES = [name for name, unit in UNITS.items() if unit == "N"]


def kept(scene: str, *words: str) -> Simulation:
    simulation = Simulation(load_scene(scene, [*words]))
    simulation.keep_forces()
    return simulation


def at_rest(scene: str, *words: str, joints: dict[int, float] | None = None) -> Simulation:
    """Return a scene in static equilibrium, some of its joints moved."""
    simulation = kept(scene, *STILL, *words)
    goal = simulation.command
    for k, value in (joints or {}).items():
        goal[k] = value
    simulation.step(goal)
    return simulation


def groups(simulation: Simulation) -> dict[str, Forces]:
    """Return the forces by kind, those of all pairs of bodies together."""
    found: dict[str, list[Forces]] = {}
    for group in simulation.forces():
        found.setdefault(kind_of(group.name), []).append(group)
    return {
        kind: Forces(kind, *(np.concatenate([own[k] for own in of]) for k in (1, 2)))
        for kind, of in found.items()
    }


def total(simulation: Simulation) -> tuple[FloatArray, FloatArray]:
    """Return the sum of all forces [N], and of their moments about the origin with those that are moments [N m]."""
    found = groups(simulation)
    force, moment = np.zeros(3), np.zeros(3)
    for name in found.keys() & set(FORCES):
        force += found[name].vectors.sum(axis=0)
        moment += np.cross(found[name].points, found[name].vectors).sum(axis=0)
    if "reaction moment" in found:
        moment += found["reaction moment"].vectors.sum(axis=0)
    return force, moment


@pytest.mark.parametrize(
    ("scene", "words", "weight"),
    [
        ("tripod", ("mesh.level=2", "motion=off"), 0.032 * G),
        ("silicone", ("mesh.level=1",), 0.032 * G),
        ("finger_cable", ("motion=off",), 0.309023),
    ],
)
def test_reactions_and_weight_balance_at_rest(scene: str, words: tuple[str, ...], weight: float) -> None:
    simulation = at_rest(scene, *words)
    found = groups(simulation)
    assert found["weight"].vectors.sum(axis=0) == pytest.approx([0, 0, -weight], rel=1e-5, abs=1e-9)
    assert len(found["weight"].points) == 1
    assert found["reaction"].vectors[:, 2].sum() == pytest.approx(weight, rel=1e-5)
    force, moment = total(simulation)
    assert force == pytest.approx(np.zeros(3), abs=1e-4 * weight)
    assert moment == pytest.approx(np.zeros(3), abs=1e-5 * weight)


def test_a_clamped_beam_is_held_by_one_force_and_one_moment(tmp_path: Path) -> None:
    """Of the weight of the beam at its middle and a load at its tip, about the middle of the clamped face."""
    load = 'load=[{set="tip", force=[0.0, 0.0, 0.001]}]'
    simulation = at_rest(finger(tmp_path), load, "gravity.acceleration=[0,0,-0.02]")
    found = groups(simulation)
    weight = 1070 * 0.1 * 0.02 * 0.015 * 0.02
    assert found["reaction"].points == pytest.approx(np.array([[0, 0.01, 0.0075]]), abs=1e-12)
    assert found["reaction"].vectors == pytest.approx(np.array([[0, 0, weight - 0.001]]), abs=1e-9)
    moment = 0.1 * 0.001 - 0.05 * weight
    assert found["reaction moment"].vectors == pytest.approx(np.array([[0, moment, 0]]), rel=1e-5, abs=1e-9)
    assert found["load"].vectors.sum(axis=0) == pytest.approx([0, 0, 0.001])
    assert total(simulation)[1] == pytest.approx(np.zeros(3), abs=1e-10)


def test_each_patch_of_held_nodes_has_a_reaction_of_its_own() -> None:
    simulation = at_rest("cloth", "springs.nodes=6")
    reaction = groups(simulation)["reaction"]
    corners = simulation.positions[simulation.fixed]
    assert len(corners) == 2
    assert reaction.points == pytest.approx(corners)
    assert len(groups(simulation)["reaction moment"].points) == 0
    assert total(simulation)[0] == pytest.approx(np.zeros(3), abs=1e-6)


def test_a_prescribed_plane_is_held_along_its_axis_alone(tmp_path: Path) -> None:
    words = 'prescribed=[{set="tip", axes="x", move="0: 0,0,0; 0.005: 0.001,0,0"}]'
    reaction = groups(at_rest(finger(tmp_path), words))["reaction"]
    assert len(reaction.points) == 2
    moved = reaction.vectors[reaction.points[:, 0].argmax()]
    assert moved[0] > 0.5
    assert not moved[1:].any()


def test_a_plane_of_symmetry_beside_a_clamp_is_a_patch_of_its_own(tmp_path: Path) -> None:
    words = 'fixed=[{set="root"}, {low=[-1,-1,-1], high=[1,0,1], axes="y"}]'
    reaction = groups(at_rest(finger(tmp_path), words, "gravity={}"))["reaction"]
    assert len(reaction.points) == 2
    assert np.count_nonzero(reaction.vectors[:, 2]) == 1


@pytest.mark.parametrize("response", ["lagrange", "penalty"])
def test_friction_on_the_incline_is_the_part_of_the_weight_along_it(response: str) -> None:
    simulation = kept("incline", "contact.friction=0.5", f"contact.response={response}")
    for _ in range(300):
        simulation.step()
    found, tilt, weight = groups(simulation), np.radians(20), 0.3 * G
    along, normal = np.array([np.cos(tilt), 0, -np.sin(tilt)]), np.array([np.sin(tilt), 0, np.cos(tilt)])
    assert found["friction"].vectors.sum(axis=0) @ along == pytest.approx(-weight * np.sin(tilt), rel=1e-3)
    assert found["normal force"].vectors.sum(axis=0) @ normal == pytest.approx(
        weight * np.cos(tilt), rel=1e-3
    )
    block = simulation.state.rigid
    heights = (found["normal force"].points - block.centres[0]) @ block.rotations[0][:, 2]
    assert heights == pytest.approx(np.full(len(heights), -0.05), abs=1e-8)  # on the block's own face
    assert total(simulation)[0] == pytest.approx(np.zeros(3), abs=1e-3 * weight)


def test_both_of_two_bodies_that_touch_have_a_force() -> None:
    """The floor bears three boxes of a stack; what each presses on the one below is there with both signs."""
    simulation = kept("stack")
    for _ in range(60):
        simulation.step()
    normal, weight = groups(simulation)["normal force"], 0.3 * G
    up = normal.vectors[:, 2] > 0
    assert normal.vectors[up, 2].sum() == pytest.approx(6 * weight, rel=1e-3)
    assert normal.vectors[~up, 2].sum() == pytest.approx(-3 * weight, rel=1e-3)
    assert groups(simulation)["weight"].vectors[:, 2].tolist() == pytest.approx([-weight] * 3)


def test_contact_forces_name_the_body_on_which_they_act_and_that_by_which(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulation = kept("stack")
    for _ in range(60):
        simulation.step()
    found, weight = {group.name: group.vectors[:, 2].sum() for group in simulation.forces()}, 0.3 * G
    for on, by, expected in (
        ("rigid.0", "obstacle", 3), ("rigid.1", "rigid.0", 2), ("rigid.2", "rigid.1", 1),
        ("rigid.0", "rigid.1", -2), ("rigid.1", "rigid.2", -1), ("rigid.2", "rigid.0", 0),
    ):  # fmt: skip
        assert found[f"normal force on {on} by {by}"] == pytest.approx(expected * weight, rel=2e-3, abs=1e-6)
    assert not [name for name in found if "by itself" in name or "on obstacle" in name]
    assert set(found) == set(simulation.force_groups)
    cloth = kept("drape", "contact.self_contact=true")
    assert f"friction{ON}body by itself" in cloth.force_groups
    named = kept("two_cloths", f"body.0.name={'a/' * 40}").force_groups
    assert not [name for name in named if "/" in name or len(name) > 100]  # which the page refuses
    assert f"normal force{ON}ball by plate" in kept("maze", "mesh.level=1").force_groups
    monkeypatch.setattr(acting_forces, "MOST_PAIRS", 8)  # of 9
    assert [name for name in kept("stack").force_groups if name != "weight"] == ["normal force", "friction"]


def test_a_rolling_body_is_touched_on_its_surface() -> None:
    simulation = kept("bounce", "rigid.0.position=[0,0,0.05011]", "contact.restitution=0")
    for _ in range(40):
        simulation.step()
    normal = groups(simulation)["normal force"]
    assert normal.vectors == pytest.approx(np.array([[0, 0, 0.2 * G]]), rel=1e-3, abs=1e-6)
    assert normal.points == pytest.approx(simulation.rigid[0].position[None] - [0, 0, 0.05], abs=1e-9)


def test_the_ball_in_the_maze_lies_on_its_floor() -> None:
    simulation = kept("maze", "mesh.level=1", "motion=off")
    for _ in range(60):
        simulation.step()
    found, game = groups(simulation), simulation.ball_game
    assert game
    ball = game.ball.description
    own = found["normal force"].vectors[0]
    assert own == pytest.approx([0, 0, ball.mass * G], rel=1e-3, abs=1e-3 * ball.mass * G)
    assert found["normal force"].vectors[1] == pytest.approx(-own)
    lowest = simulation.ball.position - [0, 0, ball.radius]
    assert found["normal force"].points[0] == pytest.approx(lowest, abs=1e-5)
    assert found["weight"].vectors[-1] == pytest.approx([0, 0, -ball.mass * G])
    assert total(simulation)[0] == pytest.approx(np.zeros(3), abs=1e-4)


def test_friction_rolls_the_ball_in_a_maze_that_is_tilted() -> None:
    """A ball that rolls without slip on a slope is held back by 2/7 of its weight along the slope."""
    words = ("mesh.level=1", "motion=off", "ball.rolling=0", "servos.angles=[-1.3,-1.6,-1.6]")
    simulation = kept("maze", *words)
    for _ in range(8):
        simulation.step()
    found, effector = groups(simulation), simulation.effector
    assert effector
    x, y, z, w = effector.quaternion
    up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    weight = found["weight"].vectors[-1]
    down = weight - (weight @ up) * up
    assert np.linalg.norm(down) > 0.05 * np.linalg.norm(weight)
    assert found["friction"].vectors[0] == pytest.approx(
        -2 / 7 * down, rel=0.05, abs=0.02 * np.linalg.norm(down)
    )


@pytest.mark.parametrize(("words", "command"), [(BY_LENGTH, 0.01), (BY_TENSION, 2.0)])
def test_a_cable_pulls_its_points_with_its_tension(tmp_path: Path, words: str, command: float) -> None:
    """Straight from the point in the world to the last: all its forces on the body add up to the pull on the world."""
    simulation = at_rest(finger(tmp_path), words, joints={0: command})
    cable, places = groups(simulation)["cable tension"], simulation.cables(simulation.positions)["tendon"]
    tension = simulation.efforts[0] if words == BY_LENGTH else command
    assert tension > 0.1
    assert cable.points == pytest.approx(places[1:])
    end = places[-2] - places[-1]
    assert cable.vectors[-1] == pytest.approx(tension * end / np.linalg.norm(end))
    first = places[0] - places[1]
    assert cable.vectors.sum(axis=0) == pytest.approx(tension * first / np.linalg.norm(first))
    assert total(simulation)[0] == pytest.approx(np.zeros(3), abs=1e-4 * tension)
    assert total(simulation)[1] == pytest.approx(np.zeros(3), abs=1e-5 * tension)


def test_a_slack_cable_pulls_at_nothing(tmp_path: Path) -> None:
    slack = at_rest(finger(tmp_path), BY_LENGTH.replace("range", "slack=0.01, range"), joints={0: 0.0})
    assert "cable tension" in slack.force_groups
    assert not len(groups(slack)["cable tension"].points)


def test_commanded_forces_and_displacements_are_loads(tmp_path: Path) -> None:
    push = at_rest(finger(tmp_path), PUSH, joints={0: 0.2})
    load = groups(push)["load"]
    assert load.vectors == pytest.approx(np.array([[0, 0, 0.2]]))
    tip = push.watched["tip"]
    assert load.points[0] == pytest.approx(push.positions[tip].mean(axis=0), abs=2e-3)
    assert total(push)[1] == pytest.approx(np.zeros(3), abs=1e-6)
    jaw = at_rest(finger(tmp_path), JAW, joints={0: 0.003})
    assert groups(jaw)["load"].vectors == pytest.approx(np.array([[0, 0, jaw.efforts[0]]]))
    assert jaw.efforts[0] > 0.01
    assert total(jaw)[0] == pytest.approx(np.zeros(3), abs=1e-6)


def test_torques_of_servos_are_their_efforts_along_their_axes() -> None:
    simulation = at_rest("tripod", "mesh.level=2", "motion=off", joints={0: -0.6, 1: -0.4, 2: -0.2, 3: 0.01})
    found = groups(simulation)
    frames = simulation.driven_frames
    axes = np.array([frame.axis for frame in frames])
    assert found["servo torque"].vectors == pytest.approx(simulation.efforts[:, None] * axes)
    assert found["servo torque"].points[1] == pytest.approx(frames[1].point + 0.01 * frames[1].inward)
    assert np.abs(simulation.efforts).min() > 1e-3
    for k, hub in enumerate(
        found["servo torque"].points
    ):  # it is what the arm's force and moment do about the axis
        arm = found["reaction moment"].vectors[k]
        arm = arm + np.cross(found["reaction"].points[k] - hub, found["reaction"].vectors[k])
        assert arm @ axes[k] == pytest.approx(simulation.efforts[k], rel=1e-6)


def test_forces_on_explicit_nets_of_springs_are_known_too() -> None:
    words = ("springs.nodes=5", "inertia.scheme=semi_implicit_euler", "damping.mass=20", "dt=0.002")
    simulation = kept("cloth", *words)
    simulation.advance(6000)
    assert total(simulation)[0] == pytest.approx(np.zeros(3), abs=1e-3)
    assert groups(simulation)["reaction"].vectors[:, 2].sum() == pytest.approx(25 * 0.001 * G, rel=1e-3)


def test_forces_are_those_of_a_step_alone() -> None:
    simulation = Simulation(load_scene("stack"))
    with raises_naming(SceneError, "keep_forces"):
        simulation.forces()
    assert simulation.force_groups == ()
    simulation.step()
    simulation.keep_forces()
    assert simulation.forces() == ()
    simulation.step()
    assert list(groups(simulation)) == ["normal force", "friction", "weight"]
    saved = simulation.save()
    simulation.restore(saved)
    assert simulation.forces() == ()
    simulation.step()
    assert simulation.forces()
    simulation.reset()
    assert simulation.forces() == ()


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("tripod", ("mesh.level=2",)),
        ("drape", ("springs.nodes=8",)),
        ("cloth", ("springs.nodes=6", "inertia.scheme=rk4")),
        ("maze", ("mesh.level=1",)),
    ],
)
def test_to_look_at_forces_changes_no_bit(scene: str, words: tuple[str, ...]) -> None:
    looked, alone = kept(scene, *words), Simulation(load_scene(scene, [*words]))
    for _ in range(8):
        looked.step()
        looked.forces()
        alone.step()
    assert looked.positions.tobytes() == alone.positions.tobytes()
    assert looked.efforts.tobytes() == alone.efforts.tobytes()


def test_the_page_has_the_table_of_the_groups() -> None:
    rows = [line for line in str(acting_forces.__doc__).splitlines() if line.startswith("| ")]
    page = (Path(__file__).parents[2] / "docs" / "seeing.md").read_text(encoding="utf-8")
    assert all(row in page for row in rows)
    assert all(name in "".join(rows) for name in UNITS)


def test_without_them_nothing_is_imported_or_kept() -> None:
    code = (
        "import sys; from tripod_sim import Simulation, load_scene; s = Simulation(load_scene('pendulum')); s.step(); "
        "assert not {'tripod_sim.acting_forces', 'tripod_sim.contact.shown_forces'} & set(sys.modules); "
        "assert s._held_by.size == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
