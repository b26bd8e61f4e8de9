"""An operator's side of the rule in `mode`: decisions made, repeated while they are in force, withdrawn when overruled.

Pure; the caller gives the time and carries the messages.
"""

from tripod_graph.mode import NONE, Decision, Mode, ModeTracker

STAMP_STEP = 1e-3
"""Two decisions of one operator differ in their stamps by at least this [s]: by the stamp they are told apart."""


class OperatorAuthority:
    """What one operator has decided, and what is in force.

    Attributes:
        source: The name of this operator.
        tracker: What is in force.
    """

    def __init__(self, source: str) -> None:
        self.source, self.tracker = source, ModeTracker()
        self._said: Decision | None = None  # what a late joiner would hear
        self._stamp = 0.0

    @property
    def mode(self) -> Mode:
        """The mode in force."""
        return self.tracker.mode

    @property
    def held(self) -> bool:
        """Whether this operator is in charge: the decision in force is its own, and not STOP."""
        return self.tracker.is_held_by(self.source) and not self.tracker.lost

    def decide(self, mode: Mode, wall: float, now: float) -> Decision:
        """Decide on `mode`; return what to publish. `wall` and `now` [s]: see `mode`."""
        self._stamp = wall if abs(wall - self._stamp) >= STAMP_STEP else self._stamp + STAMP_STEP
        self._said = Decision(mode, self.source, self._stamp)
        self.tracker.hear(self._said, wall, now)
        return self._said

    def leave(self, wall: float, now: float) -> Decision:
        """Decide nothing any more; return what to publish. What others decided stays in force."""
        self._said = None
        said = Decision(NONE, self.source, wall)
        self.tracker.hear(said, wall, now)
        return said

    def hear(self, decision: Decision, wall: float, now: float) -> bool:
        """Take a message of any operator; return whether that changed what is in force. Raises ValueError."""
        if decision.source == self.source:  # the own echo tells nothing, and may be late
            return False
        return self.tracker.hear(decision, wall, now)

    def due(self, wall: float, now: float) -> Decision | None:
        """Return what to publish now, if anything; call it every `REPEAT`.

        What is in force is repeated; what is not any more is withdrawn once, so that no late joiner hears of it.
        """
        self.tracker.lapse(now)
        said = self._said
        if said is None or (said.mode == Mode.STOP and self.tracker.source == self.source):
            return None
        if said.mode != Mode.STOP and self.tracker.is_held_by(self.source):
            self.tracker.hear(said, wall, now)
            return said
        self._said = None
        return Decision(NONE, self.source, wall)
