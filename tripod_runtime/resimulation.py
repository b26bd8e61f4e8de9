"""Resimulation: simulates a recorded session again and compares each body with the recorded one, bit for bit."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_runtime.checkpoint import checkpoint_place, read_checkpoint
from tripod_runtime.input_log import APPLIED, HEAD
from tripod_sim.errors import SceneError
from tripod_sim.simulation import Simulation

STAMP_ERROR = 1000
"""Of stamps that are kept as floating-point numbers [ns]."""


class Ended(Exception):  # noqa: N818 - the end of a session is no error
    """All recorded steps are made."""


@dataclass(frozen=True)
class Commands:
    """Runs of a `InputLog`, shape (n, 4 + joints)."""

    rows: FloatArray


@dataclass(frozen=True)
class Applied:
    """Runs of forces of a `InputLog`, shape (m, 7)."""

    rows: FloatArray


@dataclass(frozen=True)
class Saved:
    """A checkpoint, as bytes."""

    data: bytes


@dataclass(frozen=True, eq=False)
class Body:
    """A recorded body: stamp [ns], steps since the reset, positions [m], (n, 3)."""

    stamp: int
    step: int
    positions: FloatArray


@dataclass
class Outcome:
    """How the steps made again compare.

    Attributes:
        steps: Made.
        equal, different: Bodies that are the recorded ones bit for bit, and those that are not.
        largest: Distance of a node from the recorded one [m].
        parted: Where they differ first, in words.
        lost: Steps that could not be made: the recording lacks what came before them.
        unknown: Recorded bodies to which no recorded step leads.
    """

    steps: int = 0
    equal: int = 0
    different: int = 0
    largest: float = 0.0
    parted: str = ""
    lost: int = 0
    unknown: int = 0


@dataclass
class Resimulation:
    """Simulates a recorded session again and compares each recorded body.

    Call `joints`, step with what it returns, call `compare`; until `joints` raises `Ended`.

    Attributes:
        simulation: Of the recorded scene, in its start state.
        stamp: Of the step at hand in the recording [ns].
        outcome: So far.
    """

    simulation: Simulation
    commands: Iterable[Commands | Applied | Saved]
    bodies: Iterable[Body]
    stamp: float = 0.0
    outcome: Outcome = field(default_factory=Outcome)

    def __post_init__(self) -> None:
        self._saved: dict[tuple[int, int], bytes] = {}
        self._pushed = False
        self._applied: dict[int, list[FloatArray]] = {}  # runs of forces by their epoch
        self._due: dict[int, Body] = {}
        self._last: tuple[int, int] = (0, -1)  # stamp and step of the body compared last
        self._coming = iter(self.bodies)
        self._body = next(self._coming, None)
        self._steps = self._play()

    def joints(self) -> FloatArray | None:
        """Return what the next step is made with, having reset the simulation or brought it to a checkpoint if need be.

        Raises:
            Ended: there is no next step.
            SceneError: the recording is of another scene.
        """
        try:
            return next(self._steps)
        except StopIteration:
            raise Ended from None

    def compare(self) -> None:
        """Compare the body after a step with the recorded one, if there is one of this step."""
        self.outcome.steps += 1
        self._look(self.simulation.state.step)

    def _play(self) -> Iterator[FloatArray | None]:
        simulation = self.simulation
        servos = bool(simulation.joints)
        width = HEAD + (simulation.command.size if servos else 0)
        here = (0, -1)  # epoch and step, where the body is the recorded one
        for row in self._rows(width):
            epoch, first, last = (int(number) for number in row[:3])
            self.stamp = row[3]
            before = (epoch, first - 1)
            data = self._saved.pop(before, b"")
            self._gather(self.stamp, first, last)
            if first == 1:
                simulation.reset()
                self._look(0)
            if data:  # also at the start: somebody may have changed the state there
                saved = read_checkpoint(data, simulation)
                simulation.restore((saved.state, saved.efforts))
            elif first != 1 and here != before:
                self.outcome.lost += last - first + 1
                self._leave()
                continue
            forces = self._applied.get(epoch, [])
            for step in range(first, last + 1):
                self._push(step, forces)
                yield row[HEAD:] if servos else None
            here = (epoch, last)
            self._leave()
        self._gather(np.inf, 1, 0)

    def _rows(self, width: int) -> Iterator[FloatArray]:
        """Yield the runs; a checkpoint that was published before a batch of them may stand behind it."""
        waiting: FloatArray | None = None
        for item in self.commands:
            if isinstance(item, Saved):
                self._saved[checkpoint_place(item.data)] = item.data
                continue
            if isinstance(item, Applied):
                self._keep_applied(item.rows)
                continue
            if (
                item.rows.ndim != 2
                or item.rows.shape[1] != width
                or not np.isfinite(item.rows[:, :HEAD]).all()
            ):
                raise SceneError(
                    f"the recording has commands of shape {item.rows.shape}; scene {self.simulation.scene.name!r} "
                    f"needs {width} columns: was it recorded with another scene?"
                )
            if waiting is not None:
                yield from waiting
            waiting = item.rows
        if waiting is not None:
            yield from waiting

    def _keep_applied(self, rows: FloatArray) -> None:
        if rows.ndim != 2 or rows.shape[1] != APPLIED or not np.isfinite(rows).all():
            raise SceneError(
                f"the recording has applied forces of shape {rows.shape}; they need {APPLIED} columns of finite numbers"
            )
        for row in rows:
            self._applied.setdefault(int(row[0]), []).append(row)

    def _push(self, step: int, forces: list[FloatArray]) -> None:
        """Apply those of the runs `forces` that hold `step`; drop what is over."""
        forces[:] = [row for row in forces if row[2] >= step]
        acting = {int(row[3]): row[4:] for row in forces if row[1] <= step}
        if acting or self._pushed:
            self.simulation.apply_forces(acting)
        self._pushed = bool(acting)

    def _gather(self, until: float, first: int, last: int) -> None:
        """Keep the bodies of steps `first` to `last`, of those that are stamped `until` [ns] or earlier."""
        while self._body and self._body.stamp <= until + STAMP_ERROR:
            body, self._body = self._body, next(self._coming, None)
            if first <= body.step <= last or (body.step == 0 and first == 1):
                self._due[body.step] = body
            elif (body.stamp, body.step) != self._last:  # a body that stands still is published again
                self.outcome.unknown += 1

    def _leave(self) -> None:
        self.outcome.unknown += len(self._due)
        self._due.clear()

    def _look(self, step: int) -> None:
        """Compare the body with the recorded one of this step, if there is one."""
        body = self._due.pop(step, None)
        if body is None:
            return
        self._last, found = (body.stamp, step), self.outcome
        shown = self.simulation.shown(self.simulation.positions)
        if shown.shape != body.positions.shape:
            raise SceneError(
                f"the recording has a body of {len(body.positions)} nodes; the scene has {len(shown)}: was it "
                "recorded with another scene?"
            )
        if shown.tobytes() == body.positions.tobytes():
            found.equal += 1
            return
        found.different += 1
        distances = np.linalg.norm(shown - body.positions, axis=1)
        found.largest = max(found.largest, float(distances.max()))
        if not found.parted:
            node = int(distances.argmax())
            found.parted = (
                f"step {step} ({self.simulation.state.time:.3f} s): node {node} by {distances[node]:.2g} m"
            )
