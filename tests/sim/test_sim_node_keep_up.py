"""The simulator's node on a machine that is too slow: what changes, what goes on, what is told, and STOP in between."""

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("tripod_msgs")

from std_msgs.msg import Float64MultiArray, UInt8MultiArray
from tripod_msgs.msg import BodyState, ControlMode, SimStatus

from tests.messages import lines_naming
from tests.sim.overload import SET, Said, write_study
from tests.sim.sim_graph import DEADLINE, PUBLISHED
from tripod_graph import names
from tripod_sim import Simulation, keep_up, load_scene
from tripod_sim.rerun import Body, Commands, Ended, Rerun, Saved
from tripod_sim.scene_file import scene_from_toml

pytestmark = pytest.mark.ros

GIVEN_UP = ("0.31 of real time", "mesh.element=h8_modes", "inertia.scheme=bdf2", "dt=0.005", "6 %", "3 %")
BACK = ("settings asked for", "3 %")
"""What is named when it goes to the cheaper setting, and when it comes back."""


@pytest.fixture
def slow(make: Callable[..., Any], tmp_path: Path) -> Callable[..., tuple[Any, Said]]:
    """Start a graph whose machine is as slow as the second thing that it returns says."""

    def start(**parameters: object) -> tuple[Any, Said]:
        study = write_study(tmp_path / "two.json")
        graph, said = make(keep_up=True, study=str(study), set=SET, timeout=60.0, **parameters), Said()
        graph.start()
        graph.node._keep_up._meter = said
        return graph, said

    return start


def look(graph: Any) -> None:
    """Let the node's own timer be impatient."""
    graph.node._keep_up.look()


def come_down(graph: Any, said: Said) -> None:
    said.burden()
    graph.wait(lambda: look(graph) or graph.node._keep_up.down, "the cheaper setting")


def go_up(graph: Any, said: Said) -> None:
    said.relieve()
    graph.wait(lambda: look(graph) or not graph.node._keep_up.down, "the way back")


def test_it_tells_what_it_gave_up_and_everybody_gets_the_other_mesh(slow: Callable[..., Any]) -> None:
    graph, said = slow()
    cheap = Simulation(
        load_scene("tripod", [SET, "mesh.element=h8_modes", "inertia.scheme=bdf2", "dt=0.005"])
    )
    asked = Simulation(load_scene("tripod", [SET]))
    checkpoints = graph.heard[names.CHECKPOINT]
    for change, simulation, told in ((come_down, cheap, GIVEN_UP), (go_up, asked, BACK)):
        checkpoints.clear()
        change(graph, said)
        status = graph.next(names.SIM_STATUS, lambda s, told=told: lines_naming(s.message, *told))
        assert status.dt == simulation.scene.dt
        body = graph.next(names.BODY_STATE)
        assert body.topology_id == simulation.mesh.topology_id
        assert len(body.positions) == 3 * len(simulation.mesh.nodes)
        assert body.time == pytest.approx(graph.node._physics.latest.time, abs=60.0)
        assert len(graph.heard[names.MESH][-1].vertices) == len(simulation.mesh.nodes)
        assert scene_from_toml(graph.heard[names.SCENE][-1].data) == simulation.scene
        graph.wait(lambda: checkpoints, "a checkpoint")
        said_again = status.message
        graph.next(names.SIM_FIGURES, lambda m, s=said_again: json.loads(m.data)["notice"] == s)
        message = graph.next(names.DIAGNOSTICS, lambda m, s=said_again: m.status[0].message == s).status[0]
        assert message.level == b"\x01"
        seen: list[Any] = []
        late = graph.ear.create_subscription(*_latched(names.MESH, seen))
        graph.wait(lambda seen=seen: seen, "the mesh for who comes late")
        assert len(seen[-1].vertices) == len(simulation.mesh.nodes)
        graph.ear.destroy_subscription(late)
    pictures = graph.heard[names.SIM_PICTURE]
    assert len(pictures) >= 3
    rates = graph.listen_to_all(names.SIM_JOINT_STATES)
    graph.wait(lambda: len(rates) > 3, "joint states")


def _latched(topic: str, seen: list[Any]) -> tuple[Any, str, Callable[[Any], None], Any]:
    kind, qos = PUBLISHED[topic]
    return kind, topic, seen.append, qos


def test_a_motion_goes_on_through_the_change_without_a_jump(slow: Callable[..., Any]) -> None:
    graph, said = slow(pose_rate=1000.0, angle_speed=2.0)
    graph.choose(ControlMode.TELEOP)
    heard = graph.listen_to_all(names.SIM_JOINT_STATES)
    target = [-0.6, -0.5, -0.4]
    graph.command(target, seconds=60.0)
    graph.wait(lambda: graph.joints()[0] < -0.005, "motion")
    come_down(graph, said)
    assert graph.joints()[0] > -0.6 + 1e-9, "the motion was over"
    graph.command(target, seconds=0.5)
    graph.wait(lambda: graph.joints()[:3] == pytest.approx(target, abs=1e-9), "the target")
    go_up(graph, said)
    assert graph.joints()[:3] == pytest.approx(target, abs=1e-9)
    path = np.array([m.position for m in heard])
    moves = np.diff(path[:, 0])
    assert (moves <= 1e-12).all()
    assert moves.min() >= -0.2 - 1e-9  # 0.1 s of 2 rad/s: what one step moves at most, however late it comes
    status = graph.status()
    assert (status.state, status.rejected_commands) == (SimStatus.RUNNING, 0)


def test_stop_is_obeyed_while_the_other_is_built_and_holds_through_the_change(
    slow: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    graph, said = slow(angle_speed=0.05)  # it would take 30 s, much longer than what happens on the way
    building, go_on = threading.Event(), threading.Event()

    def build(scene: Any) -> Simulation:
        building.set()
        assert go_on.wait(DEADLINE)
        return Simulation(scene)

    monkeypatch.setattr(keep_up, "Simulation", build)
    graph.choose(ControlMode.TELEOP)
    graph.command([-1.5, -1.5, -1.5])
    graph.wait(lambda: graph.joints()[0] < -0.02, "motion")
    said.burden()
    graph.wait(lambda: look(graph) or building.is_set(), "building")
    graph.choose(ControlMode.STOP)
    graph.status(state=SimStatus.HOLDING)
    where = graph.joints()
    assert -1.4 < where[0] < -0.02
    assert not graph.node._keep_up.down
    go_on.set()
    graph.wait(lambda: graph.node._keep_up.down, "the cheaper setting")
    status = graph.next(names.SIM_STATUS, lambda s: lines_naming(s.message, *GIVEN_UP))
    assert (status.state, status.authority.mode) == (SimStatus.HOLDING, ControlMode.STOP)
    graph.next(names.SIM_STATUS, lambda s: s.step > status.step + 50)
    assert graph.joints() == where


def test_a_pause_holds_through_the_change_and_a_reset_goes_to_the_start(slow: Callable[..., Any]) -> None:
    graph, said = slow()
    come_down(graph, said)
    assert graph.pause(True).success
    step = graph.status(state=SimStatus.PAUSED).step
    assert graph.step().success
    assert graph.status().step == step + 1
    assert graph.reset().success
    status = graph.status(step=0)
    assert status.dt == 0.005
    assert graph.pause(False).success
    graph.wait(lambda: graph.status().step > 3, "steps after the reset")
    go_up(graph, said)
    assert graph.next(names.SIM_STATUS, lambda s: lines_naming(s.message, *BACK)).dt == 0.002


def bodies_of(published: list[Any], topology_id: str) -> list[Any]:
    """Return the bodies of a mesh among the messages, from the last change of the mesh on."""
    bodies = [m for m in published if isinstance(m, BodyState)]
    others = [k for k, m in enumerate(bodies) if m.topology_id != topology_id]
    return bodies[others[-1] + 1 if others else 0 :]


def test_a_session_with_changes_is_made_again_from_what_was_published(slow: Callable[..., Any]) -> None:
    graph, said = slow()
    published: list[Any] = []
    for topic in (names.COMMANDS, names.CHECKPOINT, names.BODY_STATE):
        kind, qos = PUBLISHED[topic]
        graph.ear.create_subscription(kind, topic, published.append, qos)
    graph.wait(
        lambda: any(isinstance(m, UInt8MultiArray) for m in published), "the checkpoint for a recorder"
    )
    graph.choose(ControlMode.TELEOP)
    graph.command([-0.2, -0.1, 0.1], seconds=0.5)
    for change in (come_down, go_up):
        change(graph, said)
        shown = graph.node._physics.simulation.mesh.topology_id
        graph.wait(lambda shown=shown: len(bodies_of(published, shown)) > 10, "bodies of its mesh")
    graph.node._physics.pause(True, DEADLINE)
    last = graph.node._physics.latest.step
    graph.wait(lambda: published and bodies_of(published, shown)[-1].step == last, "the last body")
    asked, cheap = (Simulation(scene_from_toml(m.data)) for m in graph.heard[names.SCENE][:2])
    items: list[Commands | Saved] = []
    bodies: list[Body] = []
    for m in published:
        if isinstance(m, Float64MultiArray):
            shape = [dim.size for dim in m.layout.dim]
            items.append(Commands(np.reshape(m.data, shape)))
        elif isinstance(m, UInt8MultiArray):
            items.append(Saved(bytes(m.data)))
        elif isinstance(m, BodyState):
            stamp = m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
            bodies.append(Body(stamp, m.step, np.reshape(m.positions, (-1, 3))))
    rerun = Rerun(asked, items, bodies, others=[cheap])
    used = set()
    while True:
        try:
            joints = rerun.joints()
        except Ended:
            break
        used.add(rerun.simulation.scene)
        rerun.simulation.step(joints)
        rerun.compare()
    assert used == {asked.scene, cheap.scene}
    assert not rerun.outcome.different, rerun.outcome
    assert rerun.outcome.equal > 10


def test_who_forbids_it_has_it_not(make: Callable[..., Any]) -> None:
    assert make(keep_up=False).start().node._keep_up is None


def test_with_simulated_time_nothing_is_too_slow(make: Callable[..., Any]) -> None:
    assert make(keep_up=True, publish_clock=True).start().node._keep_up is None
