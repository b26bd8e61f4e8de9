"""Steps that are slower than real time: why, and which cheaper setting to propose. The setting itself never changes."""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from tripod_host.priority import stand_back
from tripod_host.slow_machine import WHAT_TO_DO
from tripod_runtime.realtime import Speed
from tripod_sim.errors import SceneError
from tripod_sim.scene.file import load_scene
from tripod_study.accuracy.choice import changes, measured, percent, point_of, study_of, switched
from tripod_study.accuracy.machine import product_time

PERIOD = 1.0
"""Time between two calls of `LagMonitor.look`, and over which the steps are measured [s]."""

FULL = 0.9
"""Load of one core from which the setting, and not a busy machine, is too slow for real time."""

EASED = 0.6
"""Load below which a setting that was too slow no longer is: between this and `FULL` nothing changes."""

SHARE = 0.7
"""Part of the speed that the load allows below which the machine is busy, too."""

LASTING = 3
"""Calls of `LagMonitor.look` in a row that find the steps too slow before a busy machine is logged."""

LONGEST_HINT = 140
"""Of what a page tells [characters]."""

QUIET = 60.0
"""Least time between two lines of the log [s]."""

PATIENCE = 0.5
"""How long the end waits for a proposal [s]."""

ALSO = "; the machine is busy, too: close other programs"

BUSY = f"the machine is busy: {WHAT_TO_DO}"


class Proposal(NamedTuple):
    """A cheaper setting in words, or why there is none.

    Attributes:
        words: For people.
        option: Value of `--accuracy` that takes it; empty: none.
    """

    words: str
    option: str = ""


def proposal(
    source: str,
    words: Sequence[str],
    *,
    study: Path | None = None,
    speed: Callable[[], float | None] = product_time,
) -> Proposal:
    """Return which setting `--accuracy real-time` takes for a scene that is too slow, or why none is known.

    Args:
        source: Name of the scene or path of its file.
        words: Overrides that it runs with.
        study: File of a study; None: the one that comes with tripod.
        speed: See `choice.choose`.
    """
    try:
        made = load_scene(source, words)
        choice = switched(source, "real-time", words, study=study, speed=speed)
        found = study_of(source, made, study)
        here, there = (point_of(found, scene) for scene in (made, load_scene(source, choice.overrides)))
    except SceneError as error:
        return Proposal(f"no cheaper setting can be proposed: {error}")
    if here and there and here.cpu <= there.cpu:
        return Proposal(
            f"study {found.name} has no cheaper setting that runs in real time: close other programs; "
            "if that is not enough, start with `--accuracy draft`",
            "draft",
        )
    replaced = "; ".join(word for word in words if word not in choice.overrides)
    told = "not known"
    if choice.measured is not None:
        then, now = percent(choice.measured), percent(measured(found, here)) if here else ""
        told = f"about {then}{f' instead of {now}' if now not in ('', then) else ''} (measured)"
    return Proposal(
        f"`--accuracy real-time` at the start, or real-time on the page, takes {changes(made, choice.settings)}"
        f"{f' in place of {replaced}' if replaced else ''}: error {told}",
        "real-time",
    )


class LagMonitor:
    """Says when the steps are slower than real time, and proposes a setting once where theirs is the cause.

    The first call of `look`, a second after the start, measures the setting of the scene; later calls notice what
    becomes too slow.

    Attributes:
        proposal: What the setting takes and which one is proposed; empty before it was too slow.
    """

    def __init__(self, propose: Callable[[], Proposal], say: Callable[[str], None]) -> None:
        """`propose` may take seconds, see `proposal`; `say` is called for the log, in any thread."""
        self._propose, self._say = propose, say
        self._search: threading.Thread | None = None
        self._count, self._said, self._closed = 0, float("-inf"), False
        self.proposal = self._option = ""

    def look(self, speed: Speed, now: float) -> None:
        """Take the speed of the last second; call it every `PERIOD`, at the steady time `now` [s]."""
        self._count = self._count + 1 if speed.behind else 0
        if speed.behind and speed.load >= FULL and not self._search:
            self._said = now
            self._search = threading.Thread(target=self._find, args=(speed,), name="proposal", daemon=True)
            self._search.start()
        elif self._count == LASTING and now - self._said >= QUIET:
            self._said = now
            self._say(self.words(speed))

    def advice(self, speed: Speed) -> str:
        """Return why the steps are slower than real time and what to do; empty where they are not, or not known yet."""
        if not speed.behind:
            return ""
        if self._is_busy(speed):
            return BUSY
        also = speed.real_time_factor * max(speed.load, 1.0) < SHARE
        return self.proposal + (ALSO if also and self.proposal else "")

    def _is_busy(self, speed: Speed) -> bool:
        """Whether it is other programs, and not the setting, that make the steps too slow."""
        return speed.load < (EASED if self.proposal else FULL)

    def hint(self, speed: Speed) -> str:
        """Return what a user of the page can do, in `LONGEST_HINT` characters at most; empty where nothing is slow."""
        if not speed.behind:
            return ""
        todo = ["lower the speed (card Pull, load, speed)"]
        if self._is_busy(speed):
            todo.insert(0, "close other programs")
        elif self._option:
            todo.append(f"start with `--accuracy {self._option}`")
        chosen = "real time" if speed.rate >= 1.0 else f"the chosen {speed.rate:g} x"
        return f"slower than {chosen} ({speed.real_time_factor:.2f} x): {', or '.join(todo)}"

    def words(self, speed: Speed) -> str:
        """Return that the steps are slower than real time, by how much, and `advice`; empty where they are not."""
        factor = f"slower than real time: factor {speed.real_time_factor:.2f}" if speed.behind else ""
        return "; ".join(filter(None, (factor, self.advice(speed))))

    def close(self) -> None:
        """Say nothing any more."""
        self._closed = True
        if self._search:
            self._search.join(PATIENCE)

    def _find(self, speed: Speed) -> None:
        stand_back()
        told = self._propose()
        if not self._closed:
            self._option = told.option
            why = f"each simulated second takes {speed.load:.2g} s of one core, publishing included"
            self.proposal = f"{why}; {told.words}"
            self._say(self.words(speed))
