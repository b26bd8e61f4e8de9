"""What the actuators of a scene do over time: as the user says, or else the motion that the scene brings along."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.scene.scene import Scene
from tripod_sim.tables.short_forms import joints_of, posed
from tripod_sim.tables.timeline import Timeline, actuator_timelines, joint_timelines


@dataclass(frozen=True, eq=False)
class Script:
    """Joint values over time.

    Attributes:
        angles: Of the servos [rad]; None where they stay.
        slides: Of the slide [m]; None where it stays.
        others: Of other actuators, by their number among all of them.
    """

    angles: Timeline | None = None
    slides: Timeline | None = None
    others: Mapping[int, Timeline] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.angles or self.slides or self.others)

    @property
    def end(self) -> float:
        """The last time at which something changes [s]; 0 where nothing does."""
        lines = (self.angles, self.slides, *self.others.values())
        return max((float(t.times[-1]) for t in lines if t), default=0.0)

    def started(self, scene: Scene) -> Scene:
        """Return the scene with its actuators where the script begins."""
        joints = joints_of(scene)
        if not joints:
            return scene
        start = self.joints(joints.start, 0.0)
        return posed(scene, start[:-1], float(start[-1]))

    def joints(self, before: FloatArray, time: float) -> FloatArray:
        """Return commands and slide [m] at a time [s], shape (a + 1,); `before` where it is silent."""
        joints = before.copy()
        if self.angles:
            joints[: self.angles.values.shape[1]] = self.angles.at(time)
        for k, line in self.others.items():
            joints[k] = line.at(time)[0]
        if self.slides:
            joints[-1] = self.slides.at(time)[0]
        return joints


def script_of(
    scene: Scene, servo: str | None = None, slide: str | None = None, actuate: Sequence[str] = ()
) -> Script:
    """Return what `servo`, `slide` and `actuate` ask for (see `timeline.joint_timelines`), or the motion of the scene.

    Raises:
        SceneError: they cannot be read, go beyond the limits of the scene, or it has no such actuators.
    """
    joints, own = joints_of(scene), servo is None and slide is None and not actuate
    for option, text in (("--servo", servo), ("--slide", slide)):
        if text is not None and not (joints and joints.arms):
            raise SceneError(
                f"{option}: scene {scene.name!r} has no servos; leave {option} out or add [servos] to the scene"
            )
    if slide is not None and joints and not joints.slides:
        raise SceneError(
            f"--slide: no servo of scene {scene.name!r} slides; leave it out or set servo.0.inward, ..."
        )
    if not joints:
        if actuate:
            raise SceneError(f"--actuate: scene {scene.name!r} has no actuators; add [[force]] to the scene")
        return Script()
    if not own or not scene.motion:
        return Script(
            *joint_timelines(joints, servo, slide), actuator_timelines(joints, actuate, "--actuate")
        )
    motion = scene.motion
    try:
        return Script(
            *joint_timelines(
                joints, motion.servo or None, motion.slide or None, ("motion.servo", "motion.slide")
            ),
            actuator_timelines(joints, motion.actuate, "motion.actuate"),
        )
    except SceneError as error:
        raise SceneError(f"{error}; correct it, give --servo or --actuate, or use --set motion=off") from None
