"""A recorded session of the simulator: its scene, what its steps were made with, and the bodies to compare with."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tripod_graph import names
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_sim.rerun import Body, Commands, Rerun, Saved
from tripod_sim.scene import Scene
from tripod_sim.scene_file import scene_from_toml
from tripod_sim.simulation import Simulation


@dataclass(frozen=True)
class Session:
    """What a recording holds of one simulator.

    Attributes:
        bag: The recording.
        namespace: Of the simulator, with a slash at its end.
        scene: That was simulated.
    """

    bag: Bag
    namespace: str
    scene: Scene

    def rerun(self) -> Rerun:
        """Return what makes the steps again, with a new simulation. Raises SceneError, StepError."""
        return Rerun(Simulation(self.scene), self._commands(), self._bodies())

    def _commands(self) -> Iterator[Commands | Saved]:
        commands, checkpoint = self.namespace + names.COMMANDS, self.namespace + names.CHECKPOINT
        for heard in self.bag.messages({commands, checkpoint}.__contains__):
            message = self.bag.decoded(heard)
            if heard.topic == checkpoint:
                yield Saved(bytes(message.data))
                continue
            shape = tuple(dim.size for dim in message.layout.dim)
            if len(shape) != 2 or shape[0] * shape[1] != len(message.data):
                raise RecordError(f"{commands} holds what is no commands of a simulator")
            yield Commands(np.asarray(message.data, dtype=np.float64).reshape(shape))

    def _bodies(self) -> Iterator[Body]:
        topic = self.namespace + names.BODY_STATE
        for heard in self.bag.messages(topic.__eq__):
            message = self.bag.decoded(heard)
            stamp = message.header.stamp
            positions = np.asarray(message.positions, dtype=np.float64)
            yield Body(stamp.sec * 10**9 + stamp.nanosec, int(message.step), positions.reshape(-1, 3))


def read_session(bag: Bag, wanted: Callable[[str], bool] = lambda _: True) -> Session:
    """Return the session of the one simulator in a recording.

    Args:
        bag: The recording.
        wanted: Whether a topic counts, where it holds several.

    Raises:
        RecordError: it holds no session of a simulator, or several.
        SceneError: its scene is not one of this version.
    """
    found = [t.removesuffix(names.SCENE) for t in bag.topics if t.endswith("/" + names.SCENE) and wanted(t)]
    whole = [n for n in found if n + names.COMMANDS in bag.topics]
    if not whole:
        raise RecordError(
            f"{bag.info.path} does not hold what the simulator was given ({names.SCENE} and {names.COMMANDS}): "
            "it cannot be played into the simulator"
        )
    if len(whole) > 1:
        raise RecordError(
            f"{bag.info.path} holds {len(whole)} simulators, of {', '.join(whole)}: choose one by "
            f"--topics '{whole[0]}*'"
        )
    scenes = dict.fromkeys(bag.decoded(heard).data for heard in bag.messages((whole[0] + names.SCENE).__eq__))
    if len(scenes) > 1:
        raise RecordError(
            f"{bag.info.path} holds {len(scenes)} scenes: the simulator was restarted with other settings in between, "
            "so its steps cannot be made again; `tripod bag play --to topics` plays what was published"
        )
    return Session(bag, whole[0], scene_from_toml(next(iter(scenes))))
