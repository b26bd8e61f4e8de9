"""Which operator is in charge, and whose commands are obeyed: one rule for all who receive and all who decide.

Pure: the caller gives the time, of two clocks. `wall` is the node's clock, with which operators stamp; it may be wrong
and may be set. `now` is steady and private: a decision in force ages by it alone, so that no step of the clock leaves
anybody deaf.
"""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from enum import IntEnum

from tripod_graph.source import is_ik


class Mode(IntEnum):
    """Values of tripod_msgs/ControlMode that can be in force."""

    STOP = 0
    TELEOP = 1
    IK = 2
    REPLAY = 3


NONE = 255
"""Value of tripod_msgs/ControlMode of an operator that decides nothing any more."""

STOP_AGE = 1.0
"""A STOP counts as made when its stamp says if that is at most this long ago [s], else as made when it is heard."""

LEASE = 1.0
"""How long a decision holds after its last repetition unless it says otherwise [s]."""

LONGEST_LEASE = 600.0
"""Longest lease that a decision may ask for [s]."""

REPEAT = 0.2
"""How often operators repeat a decision that is in force [s]."""

RETURN = 4.0
"""An operator that is heard again within this time after its lease ended [s] goes on; later it has to decide again."""

PAUSE = 2.0
"""An overruled decision that is still repeated at shorter intervals than this [s] is the old one, not a new one."""

STRAGGLERS = 0.5
"""Repetitions that come so soon after they were overruled [s] were under way, and are not worth a word."""

SILENCE = 0.5
"""Inverse kinematics that sends nothing for this long [s] may be replaced by another."""

REMEMBERED = 64
"""How many sources are remembered, the newest."""

LONGEST_NAME = 300
"""Characters of a source's name; those of ROS itself have up to 255. Every status carries it."""


@dataclass(frozen=True)
class Decision:
    """What an operator says on `control_mode`.

    Attributes:
        mode: A value of `Mode`, or NONE.
        source: Who decided: a name that no other operator has.
        stamp: When, by the operator's clock [s]; 0: not told, it counts as now. A repetition has the same.
        lease: How long it holds after its last repetition [s]; 0: `LEASE`.
    """

    mode: int
    source: str
    stamp: float = 0.0
    lease: float = 0.0

    def __str__(self) -> str:
        known = Mode(self.mode).name if self.mode in list(Mode) else str(self.mode)
        return f"{known} by {self.source or 'nobody named'}, stamped {self.stamp:.3f} s"


@dataclass
class Ignored:
    """What was heard and not obeyed, since start.

    Attributes:
        count: How many messages.
        last: The newest of them and why, one line.
        sources: How many of each source, the newest sources.
        at: When the newest came, steady [s].
    """

    count: int = 0
    last: str = ""
    sources: OrderedDict[str, int] = field(default_factory=OrderedDict)
    at: float = float("-inf")

    def add(self, source: str, why: str, now: float) -> None:
        """Count one message."""
        source = source[:LONGEST_NAME]
        self.count, self.last, self.at = self.count + 1, why, now
        self.sources[source] = self.sources.pop(source, 0) + 1
        if len(self.sources) > REMEMBERED:
            self.sources.popitem(last=False)


@dataclass
class _Overruled:
    """A decision that was in force and is not any more, while it is still repeated."""

    stamp: float
    restamped: bool
    since: float
    heard: float


class ModeTracker:
    """Says which mode is in force, by whose decision, and whose commands are obeyed.

    - STOP is obeyed at once, whoever says it and whatever its stamp; one that is said again after `PAUSE` [s] is new.
    - Of other decisions the one made last counts, by its stamp; one stamped ahead of `wall`, or not stamped, counts as
      made when it is heard. What was decided before the one in force is ignored. A decision of the source in force
      counts as well if its stamp is newer than all that were heard of that source: one clock made them.
    - A decision holds for its lease after it was last heard. Then its operator is lost, which is a STOP. If it is
      heard again within `RETURN` [s], it goes on.
    - A decision that is repeated after it was overruled stays overruled: a new one has another stamp. The repetitions
      of a source that stamps each of them again must pause for `PAUSE` [s] first, unless that source itself had changed
      to a mode other than STOP.

    In the modes TELEOP and REPLAY the commands of the operator in charge are obeyed, in mode IK those of inverse
    kinematics: of several that which comes first in the alphabet, so that all agree, until it is silent for
    `SILENCE` [s].

    Attributes:
        source: Whose decision is in force, also where that is STOP; empty: nobody's yet.
        stamp: When it was made, as its operator says [s].
        lost: The operator in charge that is silent, empty if none is.
        ignored: Decisions not obeyed.
        ignored_commands: Commands not obeyed because of who sent them.
    """

    def __init__(self) -> None:
        self.source, self.stamp, self.lost = "", 0.0, ""
        self.ignored, self.ignored_commands = Ignored(), Ignored()
        self._mode = Mode.STOP
        self._decided = float("-inf")  # by the steady clock
        self._heard, self._lease = float("-inf"), LEASE
        self._stop_heard = float("-inf")
        self._restamped = False
        self._newest: OrderedDict[str, float] = OrderedDict()  # stamp of each source
        self._overruled: OrderedDict[tuple[str, int], _Overruled] = OrderedDict()
        self._solver, self._solver_heard = "", float("-inf")

    @property
    def mode(self) -> Mode:
        """The mode in force: STOP while the operator in charge is lost."""
        return Mode.STOP if self.lost else self._mode

    @property
    def decided(self) -> tuple[Mode, str]:
        """The mode that was decided last, and by whom, be its operator lost for the moment."""
        return self._mode, self.source

    def hear(self, decision: Decision, wall: float, now: float) -> bool:
        """Take a message; return whether another decision is in force now, be it of the same mode.

        Raises:
            ValueError: the mode is unknown, or a decision other than STOP has no source or no possible lease.
        """
        lapsed = self.lapse(now)
        if decision.mode == NONE:
            return self._leave(decision.source, now) or lapsed
        if decision.mode == Mode.STOP:
            decision = replace(decision, source=decision.source[:LONGEST_NAME])
            self._is_newest(decision)
            return self._stop(decision, wall - decision.stamp, now)
        _check(decision)
        newest = self._is_newest(decision)
        if self._mode is not Mode.STOP and (decision.mode, decision.source) == (self._mode, self.source):
            self._restamped = decision.stamp != self.stamp
            self.stamp, self._lease, self._heard = decision.stamp, decision.lease or LEASE, now
            back, self.lost = bool(self.lost), ""
            return back
        if self._is_overruled(decision, now):
            return lapsed
        age = 0.0 if decision.stamp == 0 or decision.stamp > wall else wall - decision.stamp
        decided = now - age
        own = decision.source == self.source and newest  # by one clock, be it wrong
        if not (own or decided >= self._decided):  # NaN decides nothing
            why = f"older than the decision in force, {self._in_force()}"
            if decision.source == self.lost:
                why = "its operator was silent for too long; send the decision again, with a new stamp"
            self.ignored.add(decision.source, f"{decision}: {why}", now)
            return lapsed
        self._enforce(decision, decided, now)
        return True

    def lapse(self, now: float) -> bool:
        """Look whether the operator in charge is still there; return whether that has changed. Call it regularly."""
        if self._mode is Mode.STOP:
            return False
        silent = now - self._heard
        if silent > self._lease + RETURN:
            lost, end = self.lost or self.source, self._heard + self._lease
            first = not self.lost
            self._enforce(Decision(Mode.STOP, self.source, self.stamp), end, now)
            self.lost = lost
            return first
        if silent > self._lease and not self.lost:
            self.lost = self.source
            return True
        return False

    @property
    def in_force(self) -> str:
        """What is in force, for people."""
        return next(self._lost_notice(), f"{self.mode.name} by {self.source or 'nobody named'} is in force")

    def is_held_by(self, source: str) -> bool:
        """Return whether a decision of `source` is in force, not STOP, be its operator lost for the moment."""
        return self._mode is not Mode.STOP and self.source == source

    def admits(self, source: str, now: float) -> str:
        """Return why a command of `source` is not to be obeyed, one line; empty: obey it. What is not is counted."""
        why = self._refusal(source, now)
        if why:
            self.ignored_commands.add(source, why, now)
        elif self.mode is Mode.IK:
            self._solver, self._solver_heard = source, now
        return why

    def is_fed(self, now: float) -> bool:
        """Return whether whose commands are obeyed is there: inverse kinematics, too, has to be heard of."""
        return self.mode is not Mode.IK or now - self._solver_heard <= SILENCE

    def notices(self, now: float) -> Iterator[str]:
        """Yield what people should know, one line each: a lost operator, ignored commands and decisions of late."""
        yield from self._lost_notice()
        for ignored in (self.ignored_commands, self.ignored):
            if now - ignored.at < 2 * LEASE:
                yield ignored.last

    def _lost_notice(self) -> Iterator[str]:
        if self.lost:
            yield (
                f"operator {self.lost!r} is silent: the robot stops and holds its pose, then moves slowly to "
                "the park pose"
            )

    def _refusal(self, source: str, now: float) -> str:
        shown = repr(source[:LONGEST_NAME]) if source else "no name in header.frame_id"
        if self.mode is Mode.STOP:
            return f"control mode is STOP: commands are ignored, the last of {shown}"
        if self.mode is not Mode.IK:
            return (
                "" if source == self.source else f"command of {shown} ignored: {self.source!r} is in charge"
            )
        if not is_ik(source):
            return f"command of {shown} ignored: control mode is IK"
        if source <= self._solver or now - self._solver_heard > SILENCE:
            return ""
        return f"command of {shown} ignored: {self._solver!r} is in charge"

    def _in_force(self) -> str:
        return str(Decision(self._mode, self.source, self.stamp))

    def _is_newest(self, decision: Decision) -> bool:
        """Return whether its stamp is newer than those of its source before; note it."""
        before = self._newest.pop(decision.source, float("-inf"))
        newest = decision.stamp > before
        self._newest[decision.source] = decision.stamp if newest else before
        if len(self._newest) > REMEMBERED:  # that in force and the one just heard are not forgotten
            del self._newest[next(source for source in self._newest if source != self.source)]
        return newest

    def _is_overruled(self, decision: Decision, now: float) -> bool:
        key = decision.source, decision.mode
        old = self._overruled.get(key)
        if old is None:
            return False
        if now - old.heard > PAUSE or not (old.restamped or old.stamp == decision.stamp):
            del self._overruled[key]
            return False
        old.heard = now
        if now - old.since > STRAGGLERS:
            self.ignored.add(decision.source, f"{decision}: overruled by {self._in_force()}", now)
        return True

    def _stop(self, decision: Decision, age: float, now: float) -> bool:
        repeated = decision.source == self.source and now - self._stop_heard <= PAUSE
        if not (repeated and self._mode is Mode.STOP):
            self._enforce(decision, now - age if 0 <= age <= STOP_AGE else now, now)
            repeated = False
        self._stop_heard = now
        return not repeated

    def _enforce(self, decision: Decision, decided: float, now: float) -> None:
        if self._mode is not Mode.STOP:
            changed = decision.source == self.source and decision.mode != Mode.STOP  # by whoever repeated it
            restamped = self._restamped and not changed
            self._overruled[self.source, self._mode] = _Overruled(self.stamp, restamped, now, self._heard)
            if len(self._overruled) > REMEMBERED:
                self._overruled.popitem(last=False)
        self._mode, self.source, self.stamp = Mode(decision.mode), decision.source, decision.stamp
        self._lease, self._heard, self._restamped = decision.lease or LEASE, now, False
        self._decided, self.lost = decided, ""
        self.ignored.at = self.ignored_commands.at = float("-inf")  # what was ignored before is no news
        self._stop_heard = float("-inf")
        self._solver, self._solver_heard = "", float("-inf")

    def _leave(self, source: str, now: float) -> bool:
        if self._mode is Mode.STOP or source != self.source:
            return False
        self._enforce(Decision(Mode.STOP, source, self.stamp), now, now)
        return True


def _check(decision: Decision) -> None:
    """Raise ValueError unless `decision` can be in force."""
    if decision.mode not in list(Mode):
        names = ", ".join(f"{m.value} {m.name}" for m in Mode)
        raise ValueError(f"control mode {decision.mode} is unknown; modes: {names}")
    if not decision.source:
        raise ValueError(
            f"control mode {Mode(decision.mode).name} names no source; name one (only STOP needs none)"
        )
    if len(decision.source) > LONGEST_NAME:
        length, start = len(decision.source), decision.source[:60]
        raise ValueError(f"source {start!r}... has {length} characters; allowed: at most {LONGEST_NAME}")
    if not 0 <= decision.lease <= LONGEST_LEASE:  # the negation also catches NaN
        allowed = f"0 (meaning {LEASE:g}) to {LONGEST_LEASE:g} s"
        raise ValueError(f"lease of {decision.source!r:.80} is {decision.lease:g} s; allowed: {allowed}")
