"""Recorded sessions of all scenes, made again: every body is the recorded one, bit for bit."""

import io
import time
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names, raises_naming
from tests.replay.sessions import run_session, write_session
from tests.tiers import sampled
from tripod_bringup.bag_session import Session, read_sessions
from tripod_record.bag import Bag
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes, checkpoint_place, read_checkpoint
from tripod_runtime.hands import Hands
from tripod_runtime.input_log import InputLog
from tripod_runtime.resimulation import Body, Commands, Ended, Outcome, Resimulation, Saved
from tripod_sim.errors import SceneError
from tripod_sim.scene.file import load_scene, scene_names
from tripod_sim.simulation import Simulation

SESSIONS = [(name, ()) for name in scene_names()] + [
    ("tripod", ("mesh.level=1", "dt=auto", "inertia.scheme=auto")),
    ("tripod", ("mesh.level=1", "inertia.scheme=bdf2", "time_error={}")),
    ("tripod", ("mesh.level=1", "servo_dynamics={}")),
    ("tripod", ("mesh.level=1", "solver.mode=newton")),
    ("tripod", ("mesh.level=1", "inertia=off", "damping=off")),
    ("pendulum", ("springs.nodes=8", "inertia.scheme=auto", "dt=auto")),
]

SLOW = {"drape", "drape_cubes", "silicone_drop", "tripod_ball", "incline"}
"""A step of these takes tens of milliseconds."""


def made_again(resimulation: Resimulation) -> Outcome:
    while True:
        try:
            joints = resimulation.joints()
        except Ended:
            return resimulation.outcome
        resimulation.simulation.step(joints)
        resimulation.compare()


def session_of(bag: Bag) -> Session:
    (session,) = read_sessions(bag)
    return session


LONG = [s for s in SESSIONS if s[0] in {"pile", "tripod_cloth", "two_cloths"} or "dt=auto" in s[1]]
"""Those that take the longest; others show the same effects."""


@pytest.mark.parametrize(
    ("scene", "overrides"),
    sampled(SESSIONS, *(s for s in SESSIONS if s not in LONG)),
    ids=lambda v: v if isinstance(v, str) else "-".join(v),
)
def test_a_session_made_again_is_the_recorded_one(
    scene: str, overrides: tuple[str, ...], tmp_path: Path
) -> None:
    steps = 20 if scene in SLOW else 60
    at = {"reset_at": steps // 3, "checkpoint_at": 2 * steps // 3, "every": steps // 12}
    found = run_session(scene, overrides, steps=steps, seed=len(scene), **at)
    path = write_session(found, tmp_path / "whole")
    outcome = made_again(session_of(Bag(path)).resimulation())
    assert outcome.different == 0, outcome.parted
    assert (outcome.steps, outcome.lost, outcome.unknown) == (steps, 0, 0)
    assert outcome.equal == len(found.bodies)


PUSHED = [
    ("tripod", ("mesh.level=1",)),
    ("cloth", ()),
    ("drape", ()),
    ("bounce", ()),
    ("pendulum", ("dt=auto",)),
    ("tripod", ("mesh.level=1", "inertia=off", "damping=off")),
    ("silicone", ("inertia.scheme=bdf2", "mesh.level=1")),
]


@pytest.mark.parametrize(
    ("scene", "overrides"), PUSHED, ids=lambda v: v if isinstance(v, str) else "-".join(v)
)
def test_a_session_with_hands_is_made_again_bit_for_bit(
    scene: str, overrides: tuple[str, ...], tmp_path: Path
) -> None:
    """Pulled, loaded, reset and saved while that acts."""
    steps = 24 if scene in SLOW else 60
    rng = np.random.default_rng(3)
    pulled = 0

    def work(hands: Hands, made: int) -> None:
        nonlocal pulled
        nodes, owners = hands._simulation.mesh.nodes, hands._simulation.owners
        third, last = int(np.argmax(owners == 3)), int(np.argmax(owners == len(nodes) - 1))
        if made % 10 in range(2, 8):
            hands.pull(1, third, nodes[3], nodes[3] + 0.02 * rng.normal(size=3), time.monotonic())
            pulled += 1
        elif made % 10 == 8:
            hands.let_go(1)
        if made % 15 == 4:
            hands.load(last, np.array([0.01, 0.0, 0.02 * (made % 2)]))

    at = {"reset_at": steps // 3, "checkpoint_at": 2 * steps // 3, "every": 3}
    found = run_session(scene, overrides, steps=steps, seed=1, hands=work, **at)
    assert pulled and found.forces
    outcome = made_again(session_of(Bag(write_session(found, tmp_path / "whole"))).resimulation())
    assert outcome.different == 0, outcome.parted
    assert (outcome.steps, outcome.lost, outcome.unknown) == (steps, 0, 0)
    late = session_of(Bag(write_session(found, tmp_path / "late", first=len(found.rows) // 2)))
    assert made_again(late.resimulation()).different == 0
    found.forces.clear()
    without = session_of(Bag(write_session(found, tmp_path / "without")))
    assert made_again(without.resimulation()).different > 0


def test_a_recording_that_begins_late_is_made_again_from_its_first_reset_or_checkpoint(
    tmp_path: Path,
) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=120, seed=1, checkpoint_at=60)
    outcome = made_again(session_of(Bag(write_session(found, tmp_path / "late", first=1))).resimulation())
    assert outcome.different == 0, outcome.parted
    begin, saved = int(found.rows[1][0, 1]), found.checkpoints[0].state.step
    assert 1 < begin <= saved
    assert (outcome.lost, outcome.steps) == (saved - begin + 1, 120 - saved)
    assert outcome.equal == sum(s.step > saved for s in found.bodies)
    assert outcome.unknown == len(found.bodies) - outcome.equal


def test_each_segment_of_a_recording_is_made_again_by_its_own_scene(tmp_path: Path) -> None:
    """A simulator, then another accuracy chosen on the page, then the same killed and started again."""
    first = run_session("tripod", ("mesh.level=1",), steps=30, seed=9, reset_at=20)
    second = run_session("tripod", ("mesh.level=1", "mesh.element=h8_modes"), steps=20, seed=8)
    third = run_session(
        "tripod", ("mesh.level=1", "mesh.element=h8_modes"), steps=40, seed=7, checkpoint_at=20
    )
    bag = Bag(write_session(first, tmp_path / "three", then=(second, third)))
    sessions = read_sessions(bag)
    assert [one.segment.number for one in sessions] == [1, 2, 3]
    for found, session in zip((first, second, third), sessions, strict=True):
        outcome = made_again(session.resimulation())
        assert outcome.different == 0, outcome.parted
        assert (outcome.equal, outcome.steps) == (len(found.bodies), session.segment.steps)
        assert (outcome.lost, outcome.unknown) == (0, 0)


def test_a_body_that_is_not_the_recorded_one_is_told_with_its_first_step(tmp_path: Path) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=40, seed=2)
    for snapshot in found.bodies[2:]:
        snapshot.positions[5, 1] = np.nextafter(snapshot.positions[5, 1], 1.0)
    outcome = made_again(session_of(Bag(write_session(found, tmp_path / "changed"))).resimulation())
    assert (outcome.equal, outcome.different) == (2, len(found.bodies) - 2)
    assert_names(outcome.parted, f"step {found.bodies[2].step}", "node 5")
    assert 0 < outcome.largest < 1e-16


def test_commands_of_another_scene_are_refused(tmp_path: Path) -> None:
    found = run_session("tripod", ("mesh.level=1",), steps=10, seed=3)
    found.rows = [rows[:, :-1] for rows in found.rows]
    resimulation = session_of(Bag(write_session(found, tmp_path / "narrow"))).resimulation()
    with raises_naming(SceneError, "'tripod'", "8 columns"):
        resimulation.joints()


def test_a_checkpoint_is_read_back_bit_for_bit_and_only_for_its_own_scene() -> None:
    maze = Simulation(load_scene("maze", ["mesh.level=1"]))
    for _ in range(5):
        maze.step()
    data = checkpoint_bytes(Checkpoint(3, *maze.save()))
    assert checkpoint_place(data) == (3, 5)
    again = read_checkpoint(data, maze)
    assert again.epoch == 3
    assert checkpoint_bytes(again) == data
    other = Simulation(load_scene("maze", ["mesh.level=2"]))
    with raises_naming(SceneError, "another scene", "positions", "shape"):
        read_checkpoint(data, other)
    for wrong in (b"", b"PK\3\4 no", data[: len(data) // 2]):
        with raises_naming(SceneError, "not a checkpoint"):
            checkpoint_place(wrong)
        with raises_naming(SceneError, "checkpoint", "load the scene"):
            read_checkpoint(wrong, maze)


def test_a_checkpoint_from_before_free_rigid_bodies_were_in_the_state_is_read_where_there_are_none() -> None:
    def earlier(simulation: Simulation) -> bytes:
        simulation.advance(3)
        with np.load(io.BytesIO(checkpoint_bytes(Checkpoint(0, *simulation.save())))) as numbers:
            kept = {
                k: numbers[k] for k in numbers.files if k not in ("state.centre_velocities", "state.spins")
            }
        file = io.BytesIO()
        np.savez(file, **kept)
        return file.getvalue()

    silicone, stack = Simulation(load_scene("silicone", ["mesh.level=1"])), Simulation(load_scene("stack"))
    read = read_checkpoint(earlier(silicone), silicone).state
    np.testing.assert_array_equal(read.velocities, silicone.state.velocities)
    assert read.spins.shape == (0, 3)
    with raises_naming(SceneError, "state.centre_velocities"):
        read_checkpoint(earlier(stack), stack)


def test_a_state_that_was_changed_at_the_start_is_the_one_that_is_made_again(tmp_path: Path) -> None:
    scene = load_scene("tripod_ball", ["mesh.level=1"])
    recorded = Simulation(scene)
    recorded.state.rigid.centres[0, 2] += 0.01
    recorded.restore(recorded.save())
    checkpoint = checkpoint_bytes(Checkpoint(0, *recorded.save()))
    joints = recorded.command
    bodies = []
    for step in range(1, 4):
        recorded.step(joints)
        bodies.append(Body(step, step, recorded.shown(recorded.positions).copy()))
    rows = np.array([[0, 1, 3, 3, *joints]])
    resimulation = Resimulation(Simulation(scene), [Saved(checkpoint), Commands(rows)], bodies)
    assert made_again(resimulation).equal == 3
    np.testing.assert_array_equal(resimulation.simulation.state.rigid.centres, recorded.state.rigid.centres)


def test_a_session_with_a_cable_is_made_again_bit_for_bit() -> None:
    words = ["mesh.element=h8_modes", "mesh.cells=[4,1,1]", "motion=off"]
    scene = load_scene("examples/tendon_finger.toml", words)
    simulation, log, bodies = Simulation(scene), InputLog(), []
    for step in range(1, 61):
        joints = np.array([min(0.02, 5e-4 * step), 0.0])
        simulation.step(joints)
        log.add(step, 5_000_000 * step, joints)
        bodies.append(Body(5_000_000 * step, step, simulation.shown(simulation.positions).copy()))
    again = Resimulation(Simulation(scene), [Commands(log.take()[0])], bodies)
    with pytest.raises(Ended):
        while True:
            again.simulation.step(again.joints())
            again.compare()
    assert (again.outcome.steps, again.outcome.equal, again.outcome.different) == (60, 60, 0)
