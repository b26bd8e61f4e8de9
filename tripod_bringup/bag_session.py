"""A recorded session of the simulator: its scene, what its steps were made with, and the bodies to compare with."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tripod_graph import names
from tripod_record.bag import Bag
from tripod_record.errors import RecordError
from tripod_record.segments import (
    Segment,
    chosen_segment,
    command_rows,
    read_segments,
    rows_of,
    segment_lines,
    simulators,
)
from tripod_runtime.input_log import APPLIED
from tripod_runtime.resimulation import STAMP_ERROR, Applied, Body, Commands, Resimulation, Saved
from tripod_sim.scene.file import scene_from_toml
from tripod_sim.simulation import Simulation


@dataclass(frozen=True)
class Session:
    """What a recording holds of one simulator between two restarts or changes of its scene.

    Attributes:
        bag: The recording.
        namespace: Of the simulator, with a slash at its end.
        segment: Which part of the recording it is.
    """

    bag: Bag
    namespace: str
    segment: Segment

    def resimulation(self) -> Resimulation:
        """Return what makes the steps again, with a new simulation. Raises SceneError, StepError."""
        return Resimulation(Simulation(scene_from_toml(self.segment.scene)), self._commands(), self._bodies())

    def _commands(self) -> Iterator[Commands | Applied | Saved]:
        before = (names.COMMANDS, names.CHECKPOINT, names.APPLIED_FORCES)
        commands, checkpoint, applied = (self.namespace + name for name in before)
        first, last, number = self.segment.first, self.segment.last, 0
        for heard in self.bag.messages({commands, checkpoint, applied}.__contains__):
            if heard.topic != commands:
                if not first <= number <= last + 1:  # it may stand behind the commands that it precedes
                    continue
                if heard.topic == checkpoint:
                    yield Saved(bytes(self.bag.decoded(heard).data))
                else:
                    yield Applied(rows_of(self.bag, heard, APPLIED))
                continue
            if first <= number <= last:
                yield Commands(command_rows(self.bag, heard))
            number += 1

    def _bodies(self) -> Iterator[Body]:
        topic, (before, last) = self.namespace + names.BODY_STATE, self.segment.stamps
        for heard in self.bag.messages(topic.__eq__):
            message = self.bag.decoded(heard)
            stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            if before + STAMP_ERROR < stamp <= last + STAMP_ERROR:
                positions = np.asarray(message.positions, dtype=np.float64)
                yield Body(stamp, int(message.step), positions.reshape(-1, 3))


def read_sessions(bag: Bag, wanted: Callable[[str], bool] = lambda _: True) -> list[Session]:
    """Return the sessions of the one simulator in a recording, in their order.

    Args:
        bag: The recording.
        wanted: Whether a topic counts, where it holds several simulators.

    Raises:
        RecordError: it holds no session of a simulator, or several simulators.
    """
    whole = [namespace for namespace in simulators(bag) if wanted(namespace + names.SCENE)]
    if len(whole) > 1:
        raise RecordError(
            f"{bag.info.path} holds {len(whole)} simulators, of {', '.join(whole)}: choose one by "
            f"--topics '{whole[0]}*'"
        )
    sessions = [Session(bag, name, segment) for name in whole for segment in read_segments(bag, name)]
    if not sessions:
        raise RecordError(
            f"{bag.info.path} does not contain the input of the simulator ({names.SCENE} and "
            f"{names.COMMANDS}), so it cannot be played into one; record all topics"
        )
    return sessions


def read_session(
    command: str, bag: Bag, wanted: Callable[[str], bool] = lambda _: True, number: int | None = None
) -> Session:
    """Return the session of segment `number`; None: of the longest, which is told if there are others.

    Raises RecordError as `read_sessions`, and if there is no such segment.
    """
    sessions = read_sessions(bag, wanted)
    segments = [session.segment for session in sessions]
    chosen = chosen_segment(bag, segments, number)
    if number is None and len(sessions) > 1:
        line = segment_lines(bag, segments)[chosen.number - 1]
        print(
            f"tripod bag {command}: {line}; it is the longest of {len(sessions)}: choose another with "
            "--segment N",
            file=sys.stderr,
        )
    return sessions[chosen.number - 1]
