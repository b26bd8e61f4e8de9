"""Cheaper settings while the machine is too slow for those of a scene, and back when there is room again.

`accuracy.ladder` knows the settings, `accuracy.pace` decides, `handover` carries the state. The other simulation is
built in a thread, brought to where the joints are, and takes over between two steps: joints, commands, pause and STOP
go on as they are.
"""

import threading
import time as clock
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.priority import stand_back
from tripod_sim.accuracy.machine import Idle
from tripod_sim.accuracy.pace import Look, Pace
from tripod_sim.errors import SceneError, StepError
from tripod_sim.handover import carry, same_nodes, settle
from tripod_sim.realtime import Activity, RealTime
from tripod_sim.scene_file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.state import State

if TYPE_CHECKING:
    from tripod_sim.accuracy.ladder import Rung

PERIOD = 1.0
"""Time between two looks [s]."""

TOLD = 10.0
"""How long a notice is told that is over: all is as it was asked for again, or nothing can be done [s]."""

PASSES = 5
"""How often a body is brought to where the joints have gone meanwhile, at most."""

NEAR = 0.02
"""How far they may have gone since [rad, and tenths of m]: the rest of the way is done between two steps."""

CALM = 10.0
"""How long a dearer simulation waits for joints that stand still, to whose place it takes longer [s]."""


@dataclass(frozen=True)
class Settings:
    """What a simulation was built of.

    Attributes:
        source: Name of the scene, or path of its file.
        words: Overrides.
        study: File of the study that tells what is cheaper; None: the scene's own.
    """

    source: str
    words: tuple[str, ...] = ()
    study: Path | None = None


class Meter:
    """Looks at the steps of a `RealTime` from outside: it costs them nothing."""

    def __init__(self, physics: RealTime) -> None:
        self._physics = physics
        self._before: tuple[float, float, float] | None = None  # steady, simulated and CPU time [s]
        self._idle = Idle()

    def look(self) -> Look | None:
        """Return what is seen since the last call; None where there was none, or the simulation was reset since."""
        assert self._physics.ident
        cpu = clock.clock_gettime(clock.pthread_getcpuclockid(self._physics.ident))
        here, before = (clock.monotonic(), self._physics.latest.time, cpu), self._before
        self._before = here
        if before is None or here[1] < before[1]:
            self._idle.cores(0.0)
            return None
        wall, simulated, used = (b - a for a, b in zip(before, here, strict=True))
        idle = self._idle.cores(wall)
        return Look(here[0], simulated / max(wall, 1e-9), used / max(simulated, 1e-9), idle)

    def rest(self) -> None:
        """Begin anew with the next look."""
        self._before = None


class KeepUp:
    """Looks after a `RealTime`; call `look` every `PERIOD`.

    Attributes:
        down: Whether the settings are others than were asked for.
    """

    def __init__(
        self,
        physics: RealTime,
        settings: Settings,
        say: Callable[[str], None],
        changed: Callable[[Simulation], None],
        meter: Meter | None = None,
    ) -> None:
        """Prepare.

        Args:
            physics: The thread of the steps.
            settings: Of what it steps.
            say: Told each notice once; in any thread.
            changed: Called in the thread of the steps when another simulation has taken over.
            meter: Looks at `physics`; None: a new one.
        """
        self._physics, self._settings, self._say, self._changed = physics, settings, say, changed
        self._meter, self._pace = meter or Meter(physics), Pace()
        self._rungs: tuple[Rung, ...] | None = None
        self._built: dict[int, Simulation] = {}
        self._work: threading.Thread | None = None
        self._closed = False
        self._said = self._notice = ""
        self._until = 0.0

    @property
    def down(self) -> bool:
        """Whether the settings are cheaper than those that were asked for."""
        return self._pace.at > 0

    @property
    def notice(self) -> str:
        """What was given up, that all is as before, or why nothing can be done; empty while there is nothing to say."""
        return self._notice if clock.monotonic() < self._until else ""

    def close(self) -> None:
        """Begin nothing any more."""
        self._closed = True
        if self._work:
            self._work.join(2.0)

    def look(self, *, beside: bool = False) -> None:
        """See whether the machine keeps up, and begin to do something about it; not while another is built `beside`."""
        if self._closed or (self._work and self._work.is_alive()):
            return
        running = self._physics.activity is Activity.RUNNING and not beside
        if not running:
            self._meter.rest()
        if not running or (seen := self._meter.look()) is None:
            self._pace.rest()
            return
        rung = self._pace.look(seen)
        if self._pace.slow and self._rungs is None:
            self._begin(self._find, seen)
        elif rung is not None:
            self._begin(self._go, rung, seen)

    def _begin(self, act: Callable[..., None], *arguments: object) -> None:
        self._work = threading.Thread(target=act, args=arguments, name="keep up", daemon=True)
        self._work.start()

    def _tell(self, words: str, seconds: float, notice: str = "") -> None:
        """Say `words`, unless they are the last, and let `notice` (the same, if empty) be told for a time [s]."""
        if words != self._said and not self._closed:
            self._say(words)
        self._said, self._notice, self._until = words, notice or words, clock.monotonic() + seconds

    # in a thread ----------------------------------------------------------------------------------------------

    def _find(self, seen: Look) -> None:
        """Look up what is cheaper, once."""
        from tripod_sim.accuracy.ladder import ladder  # noqa: PLC0415 - only where the machine is too slow

        settings = self._settings
        try:
            rungs = ladder(settings.source, settings.words, cost=seen.cost, study=settings.study)
            self._pace.learn([rung.cost for rung in rungs])
            self._rungs = rungs
        except SceneError as error:
            self._rungs = ()
            self._tell(f"{too_slow(seen)}, and nothing cheaper is known: {error}", TOLD)

    def _go(self, rung: int, seen: Look) -> None:
        """Go on with the settings of a rung."""
        stand_back()
        assert self._rungs
        before, at, wanted = self._physics.shown[0], self._pace.at, self._rungs[rung]
        self._built[at] = before
        try:
            if rung not in self._built:
                self._built[rung] = Simulation(load_scene(self._settings.source, wanted.words))
                self._built[rung].rehearse()
            after = self._built[rung]
            if not same_nodes(before, after):
                self._bring(before, after, calm=rung < at)
            self._take_over(before, after)
        except (SceneError, StepError) as error:
            if isinstance(error, SceneError):
                self._pace.drop(rung)
            else:
                self._pace.put_off()
            self._tell(f"{too_slow(seen)}; it cannot go on with {wanted.text}: {error}", TOLD)
            return
        if self._physics.shown[0] is after:
            self._pace.moved(rung, seen.now)
            self._meter.rest()
            self._tell(*self._words(rung, at, seen))

    def _bring(self, before: Simulation, after: Simulation, *, calm: bool) -> None:
        """Bring a body to rest where the joints are; `calm`: when they stand still, as far as one can wait for that."""
        end = clock.monotonic() + CALM
        while calm and not self._closed:
            joints = self._physics.latest.joints
            clock.sleep(0.1)
            calm = clock.monotonic() < end and not np.array_equal(joints, self._physics.latest.joints)
        seen = list[State]()

        def note(simulation: Simulation) -> None:
            seen.append(simulation.state.copy())

        for _ in range(PASSES):
            self._between_steps(note)
            if not seen:
                return
            settle(before, seen[-1], after)
            if np.abs(self._physics.latest.joints - seen[-1].joints).max() < NEAR:
                return

    def _take_over(self, before: Simulation, after: Simulation) -> None:
        """Let `after` take over between two steps, and wait for it. Raises StepError."""
        failed = list[StepError]()

        def act(simulation: Simulation) -> None:
            try:
                if (
                    simulation is before
                    and not self._closed
                    and self._physics.activity is not Activity.FAILED
                ):
                    carry(before, after)
                    self._physics.change(after)
                    self._changed(after)
            except StepError as error:
                failed.append(error)

        self._between_steps(act)
        if failed:
            raise failed[0]

    def _between_steps(self, act: Callable[[Simulation], None]) -> None:
        """Have `act` called in the thread of the steps, and wait for it; not where that ends."""
        done = threading.Event()

        def then(simulation: Simulation) -> None:
            act(simulation)
            done.set()

        self._physics.between_steps(then)
        while not done.wait(0.1) and self._physics.is_alive() and not self._closed:
            pass

    def _words(self, rung: int, before: int, seen: Look) -> tuple[str, float, str]:
        """Return what is said of a change from `before` to `rung`, how long [s], and what is told meanwhile."""
        from tripod_sim.accuracy.choice import percent  # noqa: PLC0415 - only where the machine is too slow

        assert self._rungs
        below, asked = (
            "" if e is None else percent(e) for e in (self._rungs[rung].error, self._rungs[0].error)
        )
        expect = f", error below {below}" if below else ""
        instead = f" instead of {asked}" if below and asked and asked != below else ""
        why = too_slow(seen) if rung > before else "there is room again"
        now = f"now {self._rungs[rung].text}{expect}{instead}"
        meanwhile = f"machine too slow for more: {now}" if 0 < rung < before else ""
        return f"{why}: {now}", float("inf") if rung else TOLD, meanwhile


def too_slow(seen: Look) -> str:
    """Return how slow the machine is, in words."""
    return f"machine too slow ({seen.factor:.2f} of real time)"
