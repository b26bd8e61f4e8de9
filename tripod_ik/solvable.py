"""Which scenes inverse kinematics can solve for. Pure."""

from tripod_sim.scene import Scene
from tripod_sim.scene_short import effector_of, joints_of


def nothing_to_solve(scene: Scene) -> str:
    """Return why there can be no model of a scene; empty where there can."""
    if joints_of(scene) and effector_of(scene):
        return ""
    return f"scene {scene.name!r} has no servos or no effector: there is nothing to solve for"
