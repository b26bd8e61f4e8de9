"""Who commands the robot and what this page sends: rules of the sliders, the motions and the stop button."""

from collections.abc import Sequence

import numpy as np

from tripod_graph.authority import OperatorAuthority
from tripod_graph.command import CommandError, CommandLimits
from tripod_graph.joint import SHOWN
from tripod_graph.mode import Decision, Mode
from tripod_graph.names import working_pose
from tripod_host.arrays import FloatArray
from tripod_view.motion import PEAK, Trajectory, motion

PERIOD = 0.05
"""Time between two commands of the sliders [s]."""

TAKEOVER = 0.2
"""Pause between taking control and the first command [s]: the former source hears of it and falls silent."""

STALE = 1.0
"""Age at which measured joint values are no longer believed [s]."""

KEY_SPEED = 0.6
"""Of a servo whose key is down [rad/s]."""

KEY_SHARE = 0.25
"""Of its range that another joint passes through in a second while its key is down."""

KEY_HOLD = 0.3
"""Time for which keys count after the page told last that they are down [s]: silence means that they are up."""

ARRIVED = 0.02
"""A motion whose measured angles end farther than this from its goal is reported [rad; others: part of the range]."""

STUCK = 1.0
"""Time without progress after which a motion has ended, though not at its goal [s]. A simulation may run slowly."""

PROGRESS = 1e-3
"""Least progress of a motion, as a part of ARRIVED, summed over the joints."""


class Control:
    """The page as an operator.

    The page is in control while the decision about the mode that is in force is its own and not STOP. It commands only
    in mode TELEOP and in control, and only while it knows where the joints are; it starts from there.

    Times are of two clocks, see `tripod_graph.mode`: `wall` is the node's, `now` is steady and private.

    Attributes:
        authority: What this page has decided, and what is in force.
        speed: Mean speed of a motion [rad/s], where the followers' slew rate allows it.
        angles: What the sliders ask for [rad; of other joints m, N, Pa], shape (n,).
        slide: The same of the slide [m]; None while nobody has moved it.
        synced: Set when `angles` changed otherwise than by a slider; whoever shows the sliders clears it.
        moving: Name of the motion under way, empty if none.
        notice: One line for the user about the newest request that was refused; empty if none.
    """

    def __init__(self, source: str, limits: CommandLimits, speed: float) -> None:
        """`source`: name of this operator; `speed`: mean speed of a motion [rad/s]."""
        self.authority, self.limits = OperatorAuthority(source), limits
        self.speed = speed
        self.angles: FloatArray = np.zeros(limits.size)
        self.slide: float | None = None
        self._keys: tuple[int, ...] = ()
        self._keys_until = float("-inf")
        self._commanded = float("-inf")
        self.synced = True
        self.moving = ""
        self.notice = ""
        self._measured: FloatArray | None = None
        self._measured_at = float("-inf")
        self._ready_at = float("-inf")
        self._goal: FloatArray = np.zeros(limits.size + 1)
        self._motion_until: float | None = None
        self._distance, self._progress_at = float("inf"), float("-inf")

    @property
    def mode(self) -> Mode:
        """The mode in force."""
        return self.authority.mode

    @property
    def in_control(self) -> bool:
        """Whether this page is the operator."""
        return self.authority.held

    @property
    def streaming(self) -> bool:
        """Whether the sliders command the servos."""
        return self.in_control and self.mode is Mode.TELEOP

    def measured(self, now: float) -> FloatArray | None:
        """Return the joint values, shape (n + 1,) [rad, m, N, Pa], None when they are not known or too old."""
        return None if now - self._measured_at > STALE else self._measured

    def hear(self, decision: Decision, wall: float, now: float) -> None:
        """Take a decision of any operator. Raises ValueError for one that cannot be."""
        self.authority.hear(decision, wall, now)
        if not self.streaming:
            self._end_motion()

    def due(self, wall: float, now: float) -> Decision | None:
        """Return what to publish on `control_mode` now, if anything; see `OperatorAuthority.due`."""
        due = self.authority.due(wall, now)
        if not self.streaming:
            self._end_motion()
        return due

    def decide(self, mode: Mode, wall: float, now: float) -> Decision | None:
        """Decide on `mode`; return what to publish, None if it is refused (see `notice`).

        STOP is never refused.
        """
        if mode is Mode.TELEOP and self.measured(now) is None:
            self.notice = "The joint angles are not known: is the simulator or the driver running?"
            return None
        if mode is Mode.IK and self.moving:
            self.notice = (
                f"The robot is still on the way to the {self.moving}. Follow the target once it is there: "
                "from half the way the body may fold to the wrong side."
            )
            return None
        self.notice = ""
        began = mode is Mode.TELEOP and not self.streaming
        decision = self.authority.decide(mode, wall, now)
        self._end_motion()
        self._ready_at = now + TAKEOVER if began else self._ready_at
        self._follow_measured(now)
        return decision

    def measure(self, joints: FloatArray, now: float) -> None:
        """Take measured joint values, shape (n + 1,) [rad, m, N, Pa], finite, of the joints of the limits.

        While the page does not command, and after a gap, the sliders follow them.
        """
        gap = now - self._measured_at > STALE
        self._measured, self._measured_at = np.array(joints, float), now
        if gap:  # a paused simulation makes no progress, and is not stuck
            self._progress_at = now
        if gap or not self.streaming or self._motion_until is not None:
            self._follow_measured(now)

    def narrow(self, limits: CommandLimits) -> None:
        """Keep to `limits` from now on; with other joints everything begins again."""
        if limits.joints != self.limits.joints:
            self._end_motion()
            self._measured, self._measured_at, self._keys = None, float("-inf"), ()
            self.angles, self.slide = np.zeros(limits.size), None
        self.limits = limits
        self.angles = np.clip(self.angles, limits.lower[:-1], limits.upper[:-1])
        self.synced = True

    def set_angle(self, servo: int, angle: float) -> bool:
        """Ask for `angle` [rad; m, N, Pa] of the joint number `servo`; return whether it is taken: in control, finite.

        One beyond the limits is taken as the limit, and that is told. A motion under way ends where it is.
        """
        if servo >= self.limits.size or not self._takes(angle):
            return False
        low, high = self.limits.lower[servo], self.limits.upper[servo]
        self.angles[servo] = np.clip(angle, low, high)
        if self.angles[servo] != angle:
            joint = self.limits.table[servo]
            if joint.unit == "rad":
                asked, least, most = (f"{np.degrees(v):.1f}" for v in (angle, low, high))
                who, asked = f"servo {servo}", f"{asked} degrees"
            else:
                who, (asked, least, most) = joint.name, (joint.shown(v) for v in (angle, low, high))
            self.notice = f"{who}: {asked} is outside of {least} to {most}; it goes to the limit."
            self.synced = True
        return True

    def set_shown(self, joint: int, value: float) -> bool:
        """Ask for `value` of a joint that is no servo, in the unit that people read; as `set_angle`."""
        if not self.limits.count <= joint < self.limits.size:
            return False
        unit = self.limits.table[joint].unit
        return self.set_angle(joint, value / SHOWN.get(unit, (1.0, unit))[0])

    def working_pose(self) -> tuple[float, ...]:
        """Return the pose in which the robot plays; joints that are no servos stay where they are asked to be."""
        *angles, slide = working_pose(self.limits.count)
        others = self.angles[self.limits.count :].tolist()
        return (*angles, *others, slide if self.limits.count else 0.0)

    def restart(self, start: FloatArray) -> None:
        """Ask for the joint values at the start of a scene, shape (n + 1,) [rad, m, N, Pa], once a simulation is there
        again; a motion ends. Nothing happens without control, or with values of other joints.
        """
        if not self.streaming or start.shape != (self.limits.size + 1,):
            return
        self._end_motion()
        self._ask_for(start)

    def _ask_for(self, joints: FloatArray) -> None:
        """Let the sliders ask for joint values, shape (n + 1,) [rad, m, N, Pa], within the limits."""
        joints = np.clip(joints, self.limits.lower, self.limits.upper)
        self.angles, self.slide = joints[:-1], float(joints[-1]) if self.limits.count else None
        self.notice, self.synced = "", True

    def set_slide(self, place: float) -> bool:
        """Ask for the slide at `place` [m]; as `set_angle`."""
        if not self._takes(place):
            return False
        self.slide = float(np.clip(place, 0.0, self.limits.slide_max))
        if self.slide != place:
            most = 1e3 * self.limits.slide_max
            self.notice = (
                f"slide: {1000.0 * place:.1f} mm is outside of 0 to {most:.1f}; it goes to the limit."
            )
            self.synced = True
        return True

    def _takes(self, value: float) -> bool:
        """Return whether a wish is taken; a motion under way then ends."""
        if not self.streaming or not np.isfinite(value):
            self.synced = True  # the slider goes back to where it was
            return False
        self.notice = ""
        if self.moving:
            self._end_motion()
        return True

    def hold_keys(self, signs: tuple[int, ...], now: float) -> None:
        """Note which keys are down: +1 moves a servo up, -1 down. They count for KEY_HOLD; repeat them."""
        if any(signs) and not self.streaming:
            self.notice = "Press t first: these keys move the robot while the sliders command."
        if any(signs) and self.moving:
            self._end_motion()
        self._keys, self._keys_until = signs, now + KEY_HOLD

    def go(self, name: str, goal: Sequence[float], now: float) -> bool:
        """Begin a motion to `goal`, shape (n + 1,) [rad, m, N, Pa]; return whether it is taken (see `notice`).

        The page must be in control in mode TELEOP.
        """
        if not self.streaming:
            return False
        if self.measured(now) is None:
            self.notice = "The joint angles are not known: is the simulator or the driver running?"
            return False
        try:
            self.limits.check(np.array(goal, float), name)
        except CommandError as error:
            self.notice = f"Outside the limits: {error}."
            return False
        self.notice, self.moving = "", name
        self._goal = np.array(goal, float)
        self._motion_until = None
        return True

    def command(self, now: float) -> Trajectory | None:
        """Return what to publish at `now`, None for nothing; call it every PERIOD while `streaming`, or more often."""
        joints = self.measured(now)
        if not self.streaming or joints is None or now < self._ready_at:
            return None
        if self.moving and self._motion_until is None:
            path = motion(
                joints, self._goal, min(self.speed, self.limits.angle_speed / PEAK), self.limits.table
            )  # followers keep up
            self._motion_until = now + float(path.times[-1]) + 2 * PERIOD
            self._distance, self._progress_at = float("inf"), now
            if not self.limits.count:  # it has no slide
                return Trajectory(path.joints[:-1], path.times, path.positions[:, :-1])
            return path
        if self._motion_until is not None and not self._finish_motion(joints, now):
            return None
        since, self._commanded = min(now - self._commanded, PERIOD), now
        if any(self._keys) and now < self._keys_until:
            signs = np.zeros(len(self.angles))
            signs[: len(self._keys)] = self._keys[: len(signs)]
            speeds = [KEY_SPEED if j.unit == "rad" else KEY_SHARE * j.span for j in self.limits.table[:-1]]
            moved = self.angles + since * np.array(speeds) * signs
            self.angles = np.clip(moved, self.limits.lower[:-1], self.limits.upper[:-1])
            self.synced = True
        if self.slide is None:
            return Trajectory(self.limits.table[:-1], np.array([PERIOD]), self.angles[None].copy())
        goal = np.array([[*self.angles, self.slide]])
        return Trajectory(self.limits.table, np.array([PERIOD]), goal)

    def _finish_motion(self, joints: FloatArray, now: float) -> bool:
        """End a motion that has arrived, or has had its time and is stuck; return whether it has ended.

        A motion takes longer by this clock where the simulation runs slowly, so the joints tell when it has arrived.
        """
        assert self._motion_until is not None
        near = [ARRIVED if joint.unit == "rad" else ARRIVED * joint.span for joint in self.limits.table]
        off = np.abs(joints - self._goal) / np.where(np.greater(near, 0.0), near, np.inf)
        if off.sum() < self._distance - PROGRESS:
            self._distance, self._progress_at = float(off.sum()), now
        arrived = (off <= 1.0).all()
        if now < self._motion_until or not (arrived or now - self._progress_at > STUCK):
            return False
        name, goal = self.moving, self._goal
        self._end_motion()
        if (off[:-1] <= 1.0).all():  # a driver does not tell the slide
            self._ask_for(goal)
        else:
            self._follow_measured(now)
            self.notice = f"The joints did not reach the {name}."
        return True

    def _end_motion(self) -> None:
        self.moving, self._motion_until = "", None

    def _follow_measured(self, now: float) -> None:
        joints = self.measured(now)
        if joints is not None:
            self.angles = np.clip(joints[:-1], self.limits.lower[:-1], self.limits.upper[:-1])
            self.slide = None
            self.synced = True
