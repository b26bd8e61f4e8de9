"""Sessions of the simulator for tests: recorded by its own thread, written as the recorder writes them."""

import itertools
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_typestore

from tripod_graph import names
from tripod_record.topic import Qos, Topic
from tripod_record.writer import BagWriter
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes
from tripod_runtime.hands import Hands
from tripod_runtime.realtime import RealTime, Snapshot
from tripod_runtime.resimulation import Ended
from tripod_sim.scene.file import load_scene, scene_to_toml
from tripod_sim.simulation import Simulation
from tripod_sim.tables.short_forms import joints_of

STORE = get_typestore(Stores.ROS2_JAZZY)
BODY_STATE = """std_msgs/Header header
uint32 topology_id
uint64 step
float64 time
float64[] positions
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@dataclass
class Recorded:
    """What a session left."""

    simulation: Simulation
    bodies: list[Snapshot] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)
    checkpoints: list[Checkpoint] = field(default_factory=list)
    forces: list[tuple[np.ndarray, float]] = field(default_factory=list)


def run_session(
    scene: str,
    overrides: tuple[str, ...] = (),
    *,
    steps: int,
    seed: int,
    reset_at: int = 0,
    checkpoint_at: int = 0,
    every: int = 7,
    hands: Callable[[Hands, int], None] = lambda hands, made: None,
) -> Recorded:
    """Let the physics' own thread run, as fast as it can, with joints that swing and hold at random.

    At the given counts of steps it is asked, from another thread as in a node, for a reset and for a checkpoint: when
    that happens is up to the machine. Every so many steps the body is kept, and the log of inputs taken. `hands` is
    called before each step with the hands and its number.
    """
    simulation = Simulation(load_scene(scene, overrides))
    found = Recorded(simulation)
    rng, count = np.random.default_rng(seed), itertools.count(1)
    asked: list[threading.Thread] = []
    joints, limits = simulation.command, joints_of(simulation.scene)

    def request(what: Callable[[], object]) -> None:
        asked.append(threading.Thread(target=what))
        asked[-1].start()

    def command(_: float) -> np.ndarray | None:
        made = next(count)
        if made > steps:
            raise Ended
        hands(physics.hands, made)
        if made == reset_at:
            request(lambda: physics.request_reset(60.0))
        if made == checkpoint_at:
            physics.request_checkpoint()
        if limits is None:
            return None
        if made % 20 < 12:  # else they hold
            joints[:] += rng.normal(size=len(joints)) * [*[0.01] * limits.count, 1e-4]
            joints[:-1] = np.clip(joints[:-1], limits.low, limits.high)
            joints[-1] = np.clip(joints[-1], 0.0, limits.slide_max)
        return joints.copy()

    def keep(snapshot: Snapshot) -> None:
        if snapshot.step % every == 0:
            found.bodies.append(snapshot)
        if snapshot.step % (3 * every) == 0:
            take()

    def take() -> None:
        rows, forces = physics.input_log.take()
        if len(forces):
            found.forces.append((forces, rows[-1, 3]))
        if checkpoint := physics.take_checkpoint():
            found.checkpoints.append(checkpoint)
        if len(rows):
            found.rows.append(rows)

    physics = RealTime(simulation, command, rate=np.inf, on_snapshot=keep)
    physics.start()
    while not physics.ended and not physics.failure:
        physics.join(0.01)
    physics.stop(60.0)
    for thread in asked:
        thread.join()
    assert not physics.failure, physics.failure
    take()
    return found


def write_session(
    found: Recorded, directory: Path, *, first: int = 0, sync_every: int = 0, then: Sequence[Recorded] = ()
) -> Path:
    """Write a session as a recording that begins with the `first` batch of commands, and return its directory.

    `then`: sessions of other simulators, later on the same topics.
    """
    writer = BagWriter(directory)
    for topic, kind in (
        (names.SCENE, "std_msgs/msg/String"),
        (names.COMMANDS, "std_msgs/msg/Float64MultiArray"),
        (names.CHECKPOINT, "std_msgs/msg/UInt8MultiArray"),
        (names.APPLIED_FORCES, "std_msgs/msg/Float64MultiArray"),
    ):
        text, _ = STORE.generate_msgdef(kind, ros_version=2)
        writer.add_topic(Topic(f"/{topic}", kind, text, (Qos(),)))
    writer.add_topic(Topic(f"/{names.BODY_STATE}", "tripod_msgs/msg/BodyState", BODY_STATE, (Qos(),)))
    said: list[tuple[int, str, bytes]] = []

    def write(topic: str, data: bytes, stamp: float) -> None:
        said.append((int(stamp), f"/{topic}", data))

    for number, one in enumerate((found, *then)):
        _say(one, write, 0 if number else first)
    for stamp, topic, data in sorted(said, key=lambda one: one[0]):
        writer.write(topic, bytes(data), stamp)
        if sync_every and writer.messages % sync_every == 0:
            writer.sync()
    writer.close()
    return directory


def _say(found: Recorded, write: Callable[[str, bytes, float], None], first: int) -> None:
    """Write what a simulator published: topic, data and stamp [ns] of each message."""
    begin = found.rows[0][0, 3]
    T = STORE.types
    Dim, Layout = T["std_msgs/msg/MultiArrayDimension"], T["std_msgs/msg/MultiArrayLayout"]
    text = T["std_msgs/msg/String"](data=scene_to_toml(found.simulation.scene))
    write(names.SCENE, STORE.serialize_cdr(text, "std_msgs/msg/String"), begin)
    for checkpoint in found.checkpoints:
        data = np.frombuffer(checkpoint_bytes(checkpoint), np.uint8)
        message = T["std_msgs/msg/UInt8MultiArray"](layout=Layout(dim=[], data_offset=0), data=data)
        write(names.CHECKPOINT, STORE.serialize_cdr(message, "std_msgs/msg/UInt8MultiArray"), begin)
    applied = [(names.APPLIED_FORCES, rows, stamp) for rows, stamp in found.forces]
    for topic, rows, stamp in [
        *applied,
        *((names.COMMANDS, rows, rows[-1, 3]) for rows in found.rows[first:]),
    ]:
        dim = [Dim(label="", size=size, stride=0) for size in rows.shape]
        message = T["std_msgs/msg/Float64MultiArray"](
            layout=Layout(dim=dim, data_offset=0), data=rows.ravel()
        )
        write(topic, STORE.serialize_cdr(message, "std_msgs/msg/Float64MultiArray"), stamp)
    store = get_typestore(Stores.EMPTY)
    from rosbags.typesys import get_types_from_msg

    store.register(get_types_from_msg(BODY_STATE, "tripod_msgs/msg/BodyState"))
    B = store.types
    for s in found.bodies:
        sec, nanosec = divmod(s.stamp, 10**9)
        stamp = B["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        message = B["tripod_msgs/msg/BodyState"](
            header=B["std_msgs/msg/Header"](stamp=stamp, frame_id="world"),
            topology_id=0,
            step=s.step,
            time=s.time,
            positions=found.simulation.shown(s.positions).ravel(),
        )
        write(names.BODY_STATE, bytes(store.serialize_cdr(message, "tripod_msgs/msg/BodyState")), s.stamp)
