"""Servo arms as driven frames."""

from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.mesh.node_sets import NodeSets
from tripod_sim.tables.joints import Joints

SMALLER = "make clamp_radius smaller, or turn, move or scale the mesh so that a strip lies along each arm"
"""What to do where an arm holds no node."""


def servo_arms(joints: Joints, sets: NodeSets) -> tuple[DrivenFrame, ...]:
    """Return the driven frame of each servo. Raises SceneError where there is no such set, or no node in it."""
    return tuple(
        DrivenFrame(
            sets.nodes(arm.held, arm.field)
            if isinstance(arm.held, str)
            else sets.inside(arm.held, arm.field, SMALLER),
            arm.axis,
            arm.hub,
            arm.inward,
        )
        for arm in joints.arms
    )
