"""What the driver publishes, as ROS messages."""

import math
from collections.abc import Sequence

from sensor_msgs.msg import Imu
from tripod_msgs.msg import RobotStatus

from tripod_driver.driver import Driver
from tripod_driver.imu import ImuReading
from tripod_graph import names
from tripod_graph.control_mode import authority_message
from tripod_graph.joint import Joint

ANGLE_VARIANCE = math.radians(2.0) ** 2
"""Of roll and pitch of the IMU that the workshop uses, a BNO055 [rad^2]."""

YAW_VARIANCE = math.pi**2
"""Of an angle that nobody measures [rad^2]."""


def status_message(driver: Driver) -> RobotStatus:
    """Return the status of the driver, without a stamp."""
    safety = driver.safety
    return RobotStatus(
        state=safety.state,
        message=driver.message,
        port=driver.link.port.name,
        protocol=driver.link.session.name,
        joint_names=[joint.name for joint in safety.joints],
        units=[joint.unit for joint in safety.joints],
        commanded=safety.commanded,
        sent=driver.sent,
        place_known=safety.place_known,
        packets_sent=driver.packets_sent,
        bytes_sent=driver.bytes_sent,
        reconnects=driver.link.reconnects,
        rejected_commands=safety.rejected,
        last_rejection=safety.last_rejection,
        authority=authority_message(safety.authority),
        lower=safety.range.lower[:-1],
        upper=safety.range.upper[:-1],
        speed=safety.range.speed[:-1],
    )


def joint_fields(joints: Sequence[Joint], values: Sequence[float]) -> dict[str, Sequence[float]]:
    """Return the fields `position` and `effort` of a joint state: a pressure is an effort; NaN where nothing is known.

    Where all are positions, there is no effort.
    """
    if not any(joint.is_effort for joint in joints):
        return {"position": values}
    pairs = list(zip(joints, values, strict=True))
    return {
        "position": [math.nan if joint.is_effort else value for joint, value in pairs],
        "effort": [value if joint.is_effort else math.nan for joint, value in pairs],
    }


def imu_message(reading: ImuReading) -> Imu:
    """Return the reading, without a stamp: roll and pitch of the sensor; its rotation about the vertical is unknown.

    Nothing else is measured, which a covariance of -1 says.
    """
    message = Imu()
    message.header.frame_id = names.IMU_LINK
    x, y, z, w = reading.quaternion
    message.orientation.x, message.orientation.y, message.orientation.z, message.orientation.w = x, y, z, w
    message.orientation_covariance = [
        ANGLE_VARIANCE,
        0.0,
        0.0,
        0.0,
        ANGLE_VARIANCE,
        0.0,
        0.0,
        0.0,
        YAW_VARIANCE,
    ]
    message.angular_velocity_covariance[0] = message.linear_acceleration_covariance[0] = -1.0
    return message
