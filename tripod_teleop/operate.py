"""The terminal as an operator: when it may command, what its keys decide, what it sends."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

from tripod_graph.mode import Mode, ModeTracker
from tripod_graph.names import WORKING_POSE
from tripod_teleop.drive import Drive, FloatArray
from tripod_teleop.joints import Joints
from tripod_teleop.keys import Act, Intent, Move

TAKEOVER = 0.2
"""Pause between taking control and the first command [s]: the former source hears of it and falls silent."""
STAMP_STEP = 1e-3
"""A decision is stamped at least this much after the one it overrules [s], whatever the clocks say."""
LAST_STAMP = 2.0**31 - 1.0
"""The last stamp that a ROS time can hold [s]."""
SAME_STAMP = 1e-6
"""Stamps that differ by less are one [s]; a message rounds them."""
NO_JOINTS = "the joint angles are not known: is the simulator or the driver running?"


@dataclass(frozen=True)
class Toss:
    """The servo angles between which a ball is thrown [rad], shape (3,) each; those of the public tutorial's step 6.

    Attributes:
        catch: Strips far down.
        throw: Less far: the centre comes up.
    """

    catch: Sequence[float] = (-pi / 3,) * 3
    throw: Sequence[float] = (-pi / 4,) * 3


class Operator:
    """Turns intents into decisions about the mode and into set-points.

    It drives while the newest decision of any operator is its own TELEOP, and only while it knows where the joints
    are: it starts from there, and again after a gap, so that nothing jumps. Arrows never take control, the letters do.

    Times are of two clocks: `stamp` is the node's clock, which all operators share; `now` is steady and private.

    Attributes:
        name: Of this node, for people.
        drive: The set-point.
        source: Who made the newest decision.
        notice: One line for the user, about the newest key; empty if all is said by the rest.
    """

    def __init__(
        self, name: str, drive: Drive, park: tuple[float, float, float, float], toss: Toss | None = None
    ) -> None:
        """`park`: three angles [rad] and the slide [m] to which PARK goes; `toss`: where CATCH and THROW jump."""
        self.name, self.drive, self._park, self._toss = name, drive, park, toss or Toss()
        self.source = ""
        self.notice = ""
        self._tracker = ModeTracker()
        self._own_stamp: float | None = None
        self._ready_at = float("-inf")
        self._lost = False

    @property
    def mode(self) -> Mode:
        """The mode in force."""
        return self._tracker.mode

    @property
    def is_driving(self) -> bool:
        """Whether the set-points of this terminal are to be sent."""
        return self._own_stamp is not None and self.mode is Mode.TELEOP

    def hear(self, mode: int, source: str, stamp: float) -> None:
        """Take a decision of any operator, this one's own included. Raises ValueError for an unknown mode."""
        before = self._tracker.stamp
        self._tracker.update(mode, stamp)
        if stamp != 0 and not stamp >= before:
            return
        own = (
            self._own_stamp is not None and abs(stamp - self._own_stamp) < SAME_STAMP and source == self.name
        )
        if not own:
            self._own_stamp, self.source = None, source
            self.drive.rest()

    def decide(self, mode: Mode, stamp: float) -> float:
        """Decide on `mode`; return the stamp [s] to publish it with, which is newer than any other."""
        stamp = min(max(stamp, self._tracker.stamp + STAMP_STEP), LAST_STAMP)
        self._tracker.update(mode, stamp)
        self._own_stamp, self.source = stamp, self.name
        self.drive.rest()
        return stamp

    def act(
        self, intent: Intent, joints: Joints | None, stamp: float, now: float
    ) -> tuple[Mode, float] | None:
        """Do what a key asks for; return the mode and the stamp to be published, None for nothing.

        `joints`: where they are, None if not known. STOP is never refused.
        """
        self.notice = ""
        match intent:
            case Move():
                if self.is_driving:
                    self.drive.press(intent, now)
                else:
                    self.notice = "press t to drive by these keys"
            case Act.STOP:
                return Mode.STOP, self.decide(Mode.STOP, stamp)
            case Act.IK:
                return Mode.IK, self.decide(Mode.IK, stamp)
            case Act.TELEOP | Act.WORK | Act.PARK | Act.CATCH | Act.THROW:
                decision = self._take_control(joints, stamp, now)
                if self.is_driving and intent is Act.WORK:
                    self.drive.go("working pose", WORKING_POSE, max(now, self._ready_at))
                elif self.is_driving and intent is Act.PARK:
                    self.drive.go("park position", self._park, max(now, self._ready_at))
                elif self.is_driving and intent is Act.CATCH:
                    self.drive.jump(self._toss.catch)
                elif self.is_driving and intent is Act.THROW:
                    self.drive.jump(self._toss.throw)
                return decision
        return None

    def setpoint(self, joints: Joints | None, now: float, ahead: float = 0.0) -> FloatArray | None:
        """Return where the joints should be `ahead` [s] after `now` [s], shape (3,) or (4,); None: send nothing."""
        if not self.is_driving:
            return None
        if joints is None:
            self._lost, self.notice = True, NO_JOINTS
            return None
        if self._lost or len(joints) != len(self.drive.joints):  # a part of the graph came, went or restarted
            self.drive.start(joints)
            self._lost, self.notice = False, ""
        return None if now < self._ready_at else self.drive.setpoint(now, ahead)

    def _take_control(self, joints: Joints | None, stamp: float, now: float) -> tuple[Mode, float] | None:
        if self.is_driving:
            self.drive.rest()
            return None
        if joints is None:
            self.notice = NO_JOINTS
            return None
        decided = self.decide(Mode.TELEOP, stamp)
        self.drive.start(joints)
        self._lost, self._ready_at = False, now + TAKEOVER
        return Mode.TELEOP, decided
