"""Effect: servo arms that hold the ends of the strips."""

from functools import partial
from operator import ge

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.fields import other_unit
from tripod_sim.tables.robot import Servos
from tripod_sim.tables.short_forms import servo_tables, soft_bodies


def check(servos: Servos, scene: Described) -> None:
    """Raise SceneError if servos start out of their limits, or have another number of values than of servos."""
    tables = servo_tables(scene)
    for field, s, body in tables:
        if len(s.angles) != s.count:
            raise SceneError(
                f"{field}.angles has {len(s.angles)} values; it needs {s.count}, one for each servo"
            )
        for i, angle in enumerate(s.angles):
            if not s.angle_min <= angle <= s.angle_max:
                raise SceneError(
                    f"{field}.angles.{i} is {angle} rad; allowed: {s.angle_min} to {s.angle_max} rad"
                )
        if s.slide > s.slide_max:
            hint = other_unit(s.slide, "m", partial(ge, s.slide_max))
            raise SceneError(f"{field}.slide is {s.slide} m; allowed: 0 to {s.slide_max} m{hint}")
        if s.slide != tables[0][1].slide:
            raise SceneError(
                f"{field}.slide is {s.slide} m, {tables[0][0]}.slide {tables[0][1].slide} m; all servo bodies "
                "slide by the same distance: give both the same value"
            )
        if scene.clamp and body.name != soft_bodies(scene)[0].name:
            raise SceneError(
                f"clamp works on the first body only; {field} need ideal clamps: leave clamp out"
            )


LEVEL = 1e-6
"""Height above the plane of an arm from which on a strip is not in it [m]."""


def hold(servos: Servos, draft: Draft) -> None:
    """Let each arm drive what it holds."""
    from tripod_sim.robot.arms import servo_arms

    joints = draft.model.joints
    assert joints
    draft.driven = servo_arms(joints, draft.sets)
    for i, (arm, frame) in enumerate(zip(joints.arms, draft.driven, strict=True)):
        up = arm.frame[:, 2]
        heights = (draft.rest[frame.nodes] - arm.hub) @ up - arm.table.axis_depth
        if not isinstance(arm.held, str) and (heights.min() > LEVEL or heights.max() < -LEVEL):
            draft.notes.append(
                f"servo_{i} holds nodes {1e3 * heights.min():.3g} to {1e3 * heights.max():.3g} mm above the plane that "
                "its arm is made for, z = 0 of the body: move the mesh into that plane, or change servos.axis_depth"
            )


EFFECT = Effect(
    Servos,
    rank=80,
    there=lambda scene: bool(servo_tables(scene)),
    check=check,
    modules=("robot.arms",),
    stages={"system.System": {"drive": "servo arms", "add_driven": "servo arms"}},
    steps=("servo arms",),
    hold=hold,
)
