"""The terminal as an operator: when it may command, what its keys decide, what it sends."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, pi

import numpy as np

from tripod_graph.authority import OperatorAuthority
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import working_pose
from tripod_graph.source import name_of
from tripod_host.arrays import FloatArray
from tripod_teleop.drive import Drive
from tripod_teleop.joints import Joints
from tripod_teleop.keys import CHOSEN, Act, Choose, Intent, Move

TAKEOVER = 0.2
"""Pause between taking control and the first command [s]: the former source hears of it and falls silent."""
NO_JOINTS = "the joint angles are not known: is the simulator or the driver running?"


@dataclass(frozen=True)
class Toss:
    """The servo angles between which a ball is thrown [rad], one for each servo or one for all; those of the public
    tutorial's step 6.

    Attributes:
        catch: Strips far down.
        throw: Less far: the centre comes up.
    """

    catch: Sequence[float] = (-pi / 3,)
    throw: Sequence[float] = (-pi / 4,)


class Operator:
    """Turns intents into decisions about the mode and into set-points.

    It drives while the decision in force is its own TELEOP, and only while it knows where the joints are: it starts
    from there, and again after a gap, so that nothing jumps. Arrows never take control, the letters do.

    Times are of two clocks, see `tripod_graph.mode`: `wall` is the node's, `now` is steady and private.

    Attributes:
        authority: What this operator has decided, and what is in force.
        drive: The set-point.
        notice: One line for the user, about the newest key; empty if all is said by the rest.
        chosen: The joint that + and - move.
    """

    def __init__(self, source: str, drive: Drive, toss: Toss | None = None) -> None:
        """Begin without control.

        Args:
            source: Name of this operator.
            drive: The set-point.
            toss: Where CATCH and THROW jump.
        """
        self.authority, self.drive, self._toss = OperatorAuthority(source), drive, toss or Toss()
        self.notice = ""
        self.chosen = 2 if drive.limits.count else 0
        self._ready_at = float("-inf")
        self._lost = False
        self._limits: dict[int, float] = {}

    @property
    def mode(self) -> Mode:
        """The mode in force."""
        return self.authority.mode

    @property
    def decider(self) -> str:
        """What people call the operator whose decision is in force."""
        return name_of(self.authority.tracker.source)

    @property
    def is_driving(self) -> bool:
        """Whether the set-points of this terminal are to be sent."""
        return self.authority.held and self.mode is Mode.TELEOP

    def hear(self, decision: Decision, wall: float, now: float) -> None:
        """Take a decision of any operator. Raises ValueError for one that cannot be."""
        if self.authority.hear(decision, wall, now):
            self.drive.rest()

    def due(self, wall: float, now: float) -> Decision | None:
        """Return what to publish on `control_mode` now, if anything; see `OperatorAuthority.due`."""
        due = self.authority.due(wall, now)
        if not self.is_driving:
            self.drive.rest()
        return due

    def decide(self, mode: Mode, wall: float, now: float) -> Decision:
        """Decide on `mode`; return what to publish."""
        self.drive.rest()
        return self.authority.decide(mode, wall, now)

    def act(self, intent: Intent, joints: Joints | None, wall: float, now: float) -> Decision | None:
        """Do what a key asks for; return what to publish on `control_mode`, None for nothing.

        `joints`: where they are, None if not known. STOP is never refused.
        """
        self.notice = ""
        match intent:
            case Choose(servo):
                self._choose(servo)
            case Move():
                move = self.meant(intent)
                if not self.is_driving:
                    self.notice = "press t to drive by these keys"
                elif move.servo < self.drive.limits.size:
                    self.drive.press(move, now)
                else:
                    self.notice = self._no_servo(move.servo)
            case Act.STOP:
                return self.decide(Mode.STOP, wall, now)
            case Act.IK:
                return self.decide(Mode.IK, wall, now)
            case Act.TELEOP | Act.WORK | Act.PARK | Act.CATCH | Act.THROW:
                decision = self._take_control(joints, wall, now)
                if self.is_driving and intent is Act.WORK:
                    self._go_to_work(max(now, self._ready_at))
                elif self.is_driving and intent is Act.PARK:
                    self.drive.go("park position", self.drive.limits.park, max(now, self._ready_at))
                elif self.is_driving and intent is Act.CATCH:
                    self._jump(self._toss.catch)
                elif self.is_driving and intent is Act.THROW:
                    self._jump(self._toss.throw)
                return decision
        return None

    def setpoint(self, joints: Joints | None, now: float, ahead: float = 0.0) -> FloatArray | None:
        """Return where the joints should be `ahead` [s] after `now` [s], shape (n,) or (n + 1,); None: send nothing."""
        if not self.is_driving:
            self._lost = True
            return None
        if joints is None:
            self._lost, self.notice = True, NO_JOINTS
            return None
        if self._lost or len(joints) != len(self.drive.joints):  # a part of the graph came, went or restarted
            self.drive.start(joints)
            self._lost, self.notice = False, ""
        if now < self._ready_at:
            return None
        values = self.drive.setpoint(now, ahead)
        self._say_limits()
        return values

    def meant(self, move: Move) -> Move:
        """Return the move with the number of its joint."""
        return replace(move, servo=self.chosen) if move.servo == CHOSEN else move

    def _say_limits(self) -> None:
        """Say once which joints a key has brought to a limit, and at which angle; a motion to a pose says nothing."""
        now = self.drive.at_limits()
        arrived = (
            {}
            if self.drive.motion or self.drive.at_once
            else {k: v for k, v in now.items() if k not in self._limits}
        )
        self._limits = now
        if arrived:
            self.notice = "; ".join(
                f"{self.drive.limits.joints[k]} is at its limit of {self._shown(k, v)}: move it the other way"
                for k, v in arrived.items()
            )

    def _shown(self, joint: int, value: float) -> str:
        one = self.drive.limits.table[joint]
        return f"{degrees(value):.1f} degrees" if one.unit == "rad" else one.shown(value)

    def _go_to_work(self, now: float) -> None:
        """Begin the motion of the servos to the working pose; other joints stay."""
        limits = self.drive.limits
        if not limits.count:
            self.notice = "a robot without servos has no working pose"
            return
        *angles, slide = working_pose(limits.count)
        others = self.drive.joints[limits.count : limits.size].tolist()
        self.drive.go("working pose", [*angles, *others, slide], now)

    def _choose(self, servo: int) -> None:
        if servo < self.drive.limits.size:
            self.chosen = servo
            self.notice = f"+ and - move {self.drive.limits.joints[servo]}"
        else:
            self.notice = self._no_servo(servo)

    def _no_servo(self, servo: int) -> str:
        limits = self.drive.limits
        if limits.others:
            return f"there is no joint {servo}; the robot has {limits.size}: {', '.join(limits.required)}"
        return f"there is no servo_{servo}; the robot has {limits.count} servos"

    def _jump(self, angles: Sequence[float]) -> None:
        count = self.drive.limits.count
        if not count:
            self.notice = "catch and throw move servos; the robot has none"
        elif len(angles) in (1, count):
            self.drive.jump(np.broadcast_to(angles, count).tolist())
        else:
            self.notice = f"catch and throw have {len(angles)} angles, the robot has {count} servos"

    def _take_control(self, joints: Joints | None, wall: float, now: float) -> Decision | None:
        if self.is_driving:
            self.drive.rest()
            return None
        if joints is None:
            self.notice = NO_JOINTS
            return None
        decided = self.decide(Mode.TELEOP, wall, now)
        self.drive.start(joints)
        self._lost, self._ready_at = False, now + TAKEOVER
        return decided
