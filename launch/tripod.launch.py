"""Simulator, inverse kinematics, driver, and what else is asked for: `ros2 launch tripod tripod.launch.py --show-args`.

The driver is a lifecycle node that configures and activates itself; `autostart:=false` leaves that to a manager.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.substitutions import FindPackageShare

from launch import LaunchContext, LaunchDescription

ARGUMENTS = (
    ("namespace", "", "Namespace of all nodes: two robots in one domain have two"),
    ("scene", "", "Scene of simulator and inverse kinematics: a name or a file; their default if empty"),
    ("set", "", "Overrides of the scene, dotted.path=value, separated by semicolons"),
    ("sim", "true", "Whether the simulator runs"),
    ("ik", "true", "Whether inverse kinematics runs"),
    ("view", "false", "Whether the page is served"),
    ("servos", "3", "How many servos the robot of the driver has; that of the scene"),
    ("port", "mock", "Port of the servos: auto, mock, a device"),
    ("protocol", "", "framed, legacy, ascii or framed_or_legacy; the driver's default if empty"),
    ("calibration", "", "File of `tripod calibrate`"),
    ("autostart", "true", "Whether the driver configures and activates itself"),
    ("record", "", "Directory of recordings; nothing is recorded if empty"),
    ("params_file", "", "Parameters of all nodes, such as config/tripod.yaml of this package"),
    ("use_sim_time", "false", "Whether the nodes take the time from /clock, which the simulator publishes"),
    ("rviz", "false", "Whether RViz shows the simulated robot"),
    ("foxglove", "false", "Whether foxglove_bridge serves Foxglove"),
)

YES, NO = ("true", "1"), ("false", "0")  # whatever the case, as for the conditions of a launch


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the nodes."""
    declared = [DeclareLaunchArgument(name, default_value=d, description=text) for name, d, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes that the arguments ask for."""
    given = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    check(given)
    config = [FindPackageShare("tripod"), "config"]
    rviz = ["-d", PathJoinSubstitution([*config, "tripod.rviz"])]
    scene = {name: given[name] for name in ("scene", "set")}
    return [
        node("sim", given, scene, clock=given["use_sim_time"].lower() in YES),
        node("ik", given, scene),
        node("view", given, {}),
        LifecycleNode(
            package="tripod",
            executable="driver",
            name="driver",
            namespace=given["namespace"],
            output="screen",
            parameters=parameters(
                given,
                {name: given[name] for name in ("port", "protocol", "calibration")},
                autostart=given["autostart"].lower() in YES,
                servos=int(given["servos"]),
            ),
        ),
        node("record", given, {"directory": given["record"]}, wanted=str(bool(given["record"]))),
        Node(
            package="rviz2",
            executable="rviz2",
            namespace=given["namespace"],
            arguments=rviz,
            condition=IfCondition(given["rviz"]),
        ),
        Node(
            package="foxglove_bridge",
            executable="foxglove_bridge",
            parameters=[{"address": "127.0.0.1"}],
            condition=IfCondition(given["foxglove"]),
        ),
    ]


def check(given: Mapping[str, str]) -> None:
    """Raise ValueError for what cannot be, and for names and files that a launch would pass over."""
    own = {file.name for file in Path(__file__).parent.glob("*.launch.py")}
    if own & {
        Path(word).name for word in sys.argv
    }:  # else the names may be those of a launch file that includes this
        for name in (word.partition(":=")[0] for word in sys.argv if ":=" in word):
            if name not in given:
                raise ValueError(f"argument '{name}' is unknown; arguments: {', '.join(given)}")
    for name, default, _ in ARGUMENTS:
        if default in YES + NO and given[name].lower() not in YES + NO:
            raise ValueError(f"argument '{name}' is '{given[name]}'; allowed: true, false")
    if not given["servos"].isdecimal():
        raise ValueError(f"argument 'servos' is '{given['servos']}'; allowed: a whole number")
    if given["params_file"] and not Path(given["params_file"]).is_file():
        raise ValueError(f"argument 'params_file' is '{given['params_file']}', which is no file")


def node(
    name: str, given: Mapping[str, str], values: Mapping[str, str], *, wanted: str = "", clock: bool = False
) -> Node:
    """Return the node `name` of this package; it runs if `wanted`, by default the argument of its name, says so."""
    return Node(
        package="tripod",
        executable=name,
        name=name,
        namespace=given["namespace"],
        output="screen",
        parameters=parameters(given, values, **({"publish_clock": True} if clock else {})),
        condition=IfCondition(wanted or given[name]),
    )


def parameters(given: Mapping[str, str], values: Mapping[str, str], **more: bool | int) -> list[object]:
    """Return the file of parameters, if there is one, and what counts above it: the values that are not empty."""
    from launch_ros.parameter_descriptions import ParameterValue  # noqa: PLC0415

    file = [given["params_file"]] if given["params_file"] else []
    texts = {name: ParameterValue(value, value_type=str) for name, value in values.items() if value}
    return [*file, {**texts, **more, "use_sim_time": given["use_sim_time"].lower() in YES}]
