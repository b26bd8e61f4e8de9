"""Names of topics, services, frames and joints: the table of docs/architecture.md, written once.

Topic names are relative, so that a namespace holds a whole robot.
"""

from collections.abc import Iterable
from typing import Final

JOINT_TRAJECTORY: Final = "joint_trajectory"
CONTROL_MODE: Final = "control_mode"
TARGET_POSE: Final = "target_pose"
BODY_STATE: Final = "sim/body_state"
MESH: Final = "sim/mesh"
MAZE_MESH: Final = "sim/maze_mesh"
BALL_SHAPE: Final = "sim/ball_shape"
MARKERS: Final = "sim/markers"
POINT_CLOUD: Final = "sim/point_cloud"
SCENE: Final = "sim/scene"
COMMANDS: Final = "sim/commands"
CHECKPOINT: Final = "sim/checkpoint"
FIELD: Final = "sim/field"
FORCES: Final = "sim/forces"
APPLIED_FORCES: Final = "sim/applied_forces"
SIM_JOINT_STATES: Final = "sim/joint_states"
EFFECTOR_POSE: Final = "sim/effector_pose"
SIM_BALL_POSE: Final = "sim/ball_pose"
BALL_POSE: Final = "ball_pose"
COMPLIANCE: Final = "sim/compliance"
SIM_PICTURE: Final = "sim/picture"
SIM_FIGURES: Final = "sim/figures"
SIM_REQUEST: Final = "sim/request"
SIM_STATUS: Final = "sim/status"
IK_STATUS: Final = "ik/status"
IK_GOAL: Final = "ik/goal"
ROBOT_JOINT_STATES: Final = "robot/joint_states"
ROBOT_STATUS: Final = "robot/status"
CALIBRATION: Final = "robot/calibration"
ROBOT_IMU: Final = "robot/imu"
ROBOT_EFFECTOR_POSE: Final = "robot/effector_pose"
DIAGNOSTICS: Final = "/diagnostics"
ROBOT_DESCRIPTION: Final = "robot_description"
CLOCK: Final = "/clock"
TF: Final = "/tf"
TF_STATIC: Final = "/tf_static"


def field_topic(name: str) -> str:
    """Return the topic of a field of the soft bodies."""
    return f"{FIELD}/{name}"


FOLLOW_JOINT_TRAJECTORY: Final = "follow_joint_trajectory"
"""The action, behind `sim/` and `robot/`."""

JOINT_STATES: Final = "joint_states"
"""Where other programs look for joint states."""

SIM_RESET: Final = "sim/reset"
SIM_PAUSE: Final = "sim/pause"
SIM_STEP: Final = "sim/step"
SIM_FEATURES: Final = "sim/get_simulator_features"
SIM_STANDARD_RESET: Final = "sim/reset_simulation"
SIM_STANDARD_STEP: Final = "sim/step_simulation"
SIM_GET_STATE: Final = "sim/get_simulation_state"
SIM_SET_STATE: Final = "sim/set_simulation_state"
ROBOT_STOP: Final = "robot/stop"
ROBOT_HOME: Final = "robot/home"
RECORD_START: Final = "record/start"
RECORD_STOP: Final = "record/stop"
RECORD_SPLIT: Final = "record/split"

WORLD: Final = "world"
BASE_LINK: Final = "base_link"
IMU_LINK: Final = "imu_link"


def servo_names(count: int) -> tuple[str, ...]:
    """Return the names of the revolute joints [rad] of a robot with `count` servos; 0 is the flat piece, negative bends
    the strip down.
    """
    return tuple(f"servo_{i}" for i in range(count))


def joint_names(count: int) -> tuple[str, ...]:
    """Return the names of all joints of a robot with `count` servos: these, then the slide."""
    return (*servo_names(count), SLIDE)


def count_servos(names: Iterable[str]) -> int:
    """Return how many servos a message with these joint names is about: servo_0, servo_1 and so on without a gap."""
    found, servos = set(names), 0
    while f"servo_{servos}" in found:
        servos += 1
    return servos


SERVOS: Final = servo_names(3)
"""Those of the Tripod, which its firmware and the workshop's packets drive."""

SLIDE: Final = "slide"
"""Prismatic joint [m] of the simulated assembly: all servo bodies move inward by it. The real robot has no
such motor, so the driver accepts the name and does nothing with it."""

WORKING_ANGLE: Final = -1.4965
WORKING_SLIDE: Final = 0.035


def working_pose(count: int) -> tuple[float, ...]:
    """Return the angles of `count` servos [rad] and the slide [m] in which the robot plays: arms tipped outward, the
    Tripod's effector 8 mm below flat.
    """
    return (*(WORKING_ANGLE,) * count, WORKING_SLIDE)


WORKING_POSE: Final = working_pose(len(SERVOS))
"""That of the Tripod."""
