"""Two simulated robots in one ROS domain, in the namespaces `left` and `right`: an example to change."""

from launch.actions import IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the launch file of one robot, twice."""
    one = PathJoinSubstitution([FindPackageShare("tripod"), "launch", "tripod.launch.py"])
    return LaunchDescription(
        IncludeLaunchDescription(one, launch_arguments={"namespace": name}.items())
        for name in ("left", "right")
    )
