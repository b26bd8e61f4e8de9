"""Which scenes inverse kinematics can solve for. Pure."""

from tripod_sim.scene import Scene
from tripod_sim.tables.short_forms import effector_of, joints_of


def nothing_to_solve(scene: Scene) -> str:
    """Return why there can be no model of a scene; empty where there can."""
    joints = joints_of(scene)
    there = {"servos, cables, chambers or forces": joints, "effector": effector_of(scene)}
    missing = [name for name, found in there.items() if not found]
    if not missing:
        return ""
    tables = {"effector": "[effector]"}
    return (
        f"scene {scene.name!r} has {' and '.join(f'no {name}' for name in missing)}, which inverse kinematics needs; "
        f"add {' and '.join(tables.get(name, '[servos] or [[cable]]') for name in missing)} to the scene"
    )


def not_servos(scene: Scene, what: str) -> str:
    """Return why `what` cannot be done: it knows servos alone, and a scene has other actuators; empty where it can."""
    joints = joints_of(scene)
    if not (joints and joints.others):
        return ""
    return (
        f"scene {scene.name!r} has {', '.join(a.name for a in joints.others)} beside servos; {what} knows servos "
        "only so far; `tripod ik SCENE --target` solves for all"
    )
