"""What the servos of a scene do over time: as the user says, or else the motion that the scene brings along."""

from dataclasses import dataclass

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.scene.scene import Scene
from tripod_sim.tables.short_forms import joints_of, posed
from tripod_sim.tables.timeline import Timeline, joint_timelines


@dataclass(frozen=True, eq=False)
class Script:
    """Joint values over time.

    Attributes:
        angles: Of the servos [rad]; None where they stay.
        slides: Of the slide [m]; None where it stays.
    """

    angles: Timeline | None = None
    slides: Timeline | None = None

    def __bool__(self) -> bool:
        return bool(self.angles or self.slides)

    @property
    def end(self) -> float:
        """The last time at which something changes [s]; 0 where nothing does."""
        return max((float(t.times[-1]) for t in (self.angles, self.slides) if t), default=0.0)

    def started(self, scene: Scene) -> Scene:
        """Return the scene with its servos where the script begins."""
        joints = joints_of(scene)
        if not joints:
            return scene
        start = self.joints(joints.start, 0.0)
        return posed(scene, start[:-1], float(start[-1]))

    def joints(self, before: FloatArray, time: float) -> FloatArray:
        """Return angles [rad] and slide [m] at a time [s], shape (s + 1,); `before` where it is silent."""
        joints = before.copy()
        if self.angles:
            joints[:-1] = self.angles.at(time)
        if self.slides:
            joints[-1] = self.slides.at(time)[0]
        return joints


def script_of(scene: Scene, servo: str | None = None, slide: str | None = None) -> Script:
    """Return what `servo` and `slide` ask for (see `timeline.joint_timelines`), or the motion of the scene.

    Raises:
        SceneError: they cannot be read, go beyond the limits of the scene, or it has no servos.
    """
    joints = joints_of(scene)
    for option, text in (("--servo", servo), ("--slide", slide)):
        if text is not None and not joints:
            raise SceneError(
                f"{option}: scene {scene.name!r} has no servos; leave {option} out or add [servos] to the scene"
            )
    if slide is not None and joints and not joints.slides:
        raise SceneError(
            f"--slide: no servo of scene {scene.name!r} slides; leave it out or set servo.0.inward, ..."
        )
    if not joints:
        return Script()
    if servo is not None or slide is not None or not scene.motion:
        return Script(*joint_timelines(joints, servo, slide))
    names = ("motion.servo", "motion.slide")
    try:
        return Script(*joint_timelines(joints, scene.motion.servo, scene.motion.slide or None, names))
    except SceneError as error:
        raise SceneError(f"{error}; correct it, give --servo, or use --set motion=off") from None
