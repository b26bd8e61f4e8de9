"""The driver as a lifecycle node: configure opens the port, activate allows motion, closing parks the servos."""

import math
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Duration
from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import ControlMode, RobotStatus

from tripod_driver.calibration import Calibration
from tripod_driver.calibration_file import read_calibration
from tripod_driver.choose_session import PROTOCOLS, choose_sessions, common_bounds
from tripod_driver.driver import Driver
from tripod_driver.imu import ImuReading
from tripod_driver.link import Link
from tripod_driver.ports.choose import CHOICES, choose_port
from tripod_driver.protocol import AngleMapping
from tripod_driver.safety import Safety, State
from tripod_graph import names
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.limits import LIMIT_PARAMETERS, limits_from
from tripod_graph.parameters import Parameter, declare
from tripod_graph.qos import LATCHED_OF_ALL, RELIABLE, SENSOR
from tripod_graph.run import run_node

STATUS_PERIOD = 0.1
"""Longest time between two status messages [s]."""

SOON = 0.003
"""A new command is looked at after this time [s], when it asks for a change, not only at the next packet's turn."""

SLOWEST = 1200
"""Slowest speed of a serial port [bit/s]."""

ANGLE_VARIANCE = math.radians(2.0) ** 2
"""Of roll and pitch of the IMU that the workshop uses, a BNO055 [rad^2]."""

YAW_VARIANCE = math.pi**2
"""Of an angle that nobody measures [rad^2]."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("port", "auto", f"Where the servos are: {CHOICES}"),
    Parameter(
        "protocol",
        "framed",
        "What the board speaks: the firmware of this project, the workshop's packet, or its closed-loop text; the "
        "last tries framed first, then legacy where the board is silent",
        choices=PROTOCOLS,
    ),
    Parameter("calibration", "", "File of `tripod calibrate`; without one, the servos are the workshop's"),
    Parameter(
        "baud", 0, "Speed of a serial port, in bits a second; 0: that of the protocol", low=0, high=4_000_000
    ),
    Parameter("boot_time", 2.0, "Time a board needs after its port was opened", "s", low=0.0, high=30.0),
    Parameter(
        "write_timeout", 0.05, "A serial port that takes no bytes so long is lost", "s", low=0.001, high=1.0
    ),
    Parameter(
        "retry_min", 0.5, "Time before the port is tried again; doubles each time", "s", low=0.05, high=60.0
    ),
    Parameter("retry_max", 5.0, "Longest time between two attempts", "s", low=0.05, high=600.0),
    Parameter(
        "angle_mapping",
        AngleMapping.ROUNDED.value,
        "Angle to degrees, legacy and ascii: to the nearest, or as the workshop's program does",
        choices=tuple(mapping.value for mapping in AngleMapping),
    ),
    Parameter("rate", 50.0, "Largest number of packets a second", "Hz", low=5.0, high=50.0),
    Parameter(
        "keep_alive",
        0.1,
        "Time after which an unchanged packet is sent again; the firmware lets go after 0.5 s",
        "s",
        low=0.02,
        high=0.4,
    ),
    Parameter(
        "start",
        [],
        "Angles of the three servos when the driver starts, for boards that do not tell; unset means the park "
        "position. The workshop's program leaves them at -0.5236",
        "rad",
    ),
    *LIMIT_PARAMETERS,
    Parameter("park_time_max", 3.0, "Longest time for parking on exit", "s", low=0.0, high=60.0),
    Parameter("autostart", True, "Configure and activate at once; else a lifecycle manager does"),
)


class DriverNode(LifecycleNode):
    """Feeds `Driver` from the graph and publishes what it sends; the rules are there."""

    def __init__(self) -> None:
        super().__init__("driver")
        values = declare(self, PARAMETERS)
        self._driver = make_driver(values)
        self._safety = self._driver.safety
        self._period = 1.0 / values["rate"]
        self._park_time_max = values["park_time_max"]
        self._shown: tuple[Any, ...] = ()
        self._logged: State | None = None
        self._status_due = 0.0
        self._answer_bad_transitions()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._joint_states = self.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
        self._status = self.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
        self._imu: Publisher | None = None  # until the board has told of one
        # first the mode: the executor takes what waits in this order, and a command may follow its mode at once
        self.create_subscription(ControlMode, names.CONTROL_MODE, self._on_control_mode, LATCHED_OF_ALL)
        self.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, self._on_trajectory, RELIABLE)
        self.create_service(Trigger, names.ROBOT_STOP, self._on_stop)
        self._diagnostics = Diagnostics(self, self._report, values["port"])
        self.create_timer(self._period, self._on_timer, clock=steady)
        self._soon = self.create_timer(SOON, self._on_soon, clock=steady)
        self._soon.cancel()
        if values["autostart"]:
            self.trigger_configure()
            self.trigger_activate()

    def close(self) -> None:
        """Park within `park_time_max`, then close the port, also when parking failed."""
        try:
            self._park()
        finally:
            self._driver.disconnect(time.monotonic())

    # lifecycle ------------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the port; a port that is not there is no failure: the driver keeps trying."""
        self._driver.connect()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Allow motion."""
        self._safety.activate(time.monotonic())
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold and send nothing more."""
        self._safety.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the port."""
        self._driver.disconnect(time.monotonic())
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Park and close the port."""
        self.close()
        return super().on_shutdown(state)

    # graph ----------------------------------------------------------------------------------------------------

    def _on_trajectory(self, message: JointTrajectory) -> None:
        times = [seconds(point.time_from_start) for point in message.points]
        positions = [point.positions for point in message.points]
        try:
            self._safety.trajectory(message.joint_names, times, positions, time.monotonic())
        except ValueError as error:
            self.get_logger().warning(f"command refused: {error}", throttle_duration_sec=2.0)
            return
        if self._soon.is_canceled():
            self._soon.reset()

    def _on_control_mode(self, message: ControlMode) -> None:
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        try:
            self._safety.control_mode(message.mode, stamp, time.monotonic())
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=2.0)

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._safety.halt(time.monotonic())
        response.success, response.message = True, "holding; change the control mode to go on"
        return response

    def _on_timer(self) -> None:
        now = time.monotonic()
        if self._driver.tick(now):
            self._publish_joint_states()
        self._publish_imu()
        state, message = self._safety.state, self._safety.message
        shown = (state, message, self._safety.rejected)
        if shown != self._shown or now >= self._status_due:
            self._log_change(state, message)
            self._shown, self._status_due = shown, now + STATUS_PERIOD
            self._publish_status()

    def _on_soon(self) -> None:
        self._soon.cancel()
        self._on_timer()

    def _publish_joint_states(self) -> None:
        message = JointState(name=list(names.SERVOS), position=self._driver.sent)
        message.header.stamp = self.get_clock().now().to_msg()
        self._joint_states.publish(message)

    def _publish_imu(self) -> None:
        readings = self._driver.link.session.readings
        if not readings:
            return
        if self._imu is None:
            self._imu = self.create_publisher(Imu, names.ROBOT_IMU, SENSOR)
        message = imu_message(readings[-1])
        message.header.stamp = self.get_clock().now().to_msg()
        self._imu.publish(message)
        readings.clear()

    def _publish_status(self) -> None:
        message = status_message(self._driver)
        message.header.stamp = self.get_clock().now().to_msg()
        self._status.publish(message)

    def _report(self) -> Report:
        driver, safety, session = self._driver, self._safety, self._driver.link.session
        level = Level.WARN if safety.message else Level.OK
        if safety.state in (State.DISCONNECTED, State.FAULT):
            level = Level.ERROR
        return (
            level,
            safety.message or safety.state.name.lower(),
            {
                "state": safety.state.name,
                "control mode": safety.mode.name,
                "port": driver.link.port.name,
                "protocol": session.name,
                "packets sent": driver.packets_sent,
                "reconnects": driver.link.reconnects,
                "rejected commands": safety.rejected,
                "last rejection": safety.last_rejection,
                **session.diagnostics,
            },
        )

    def _log_change(self, state: State, message: str) -> None:
        """Log a state that is new; a link that goes or comes at a level that is seen."""
        if state is self._logged:
            return
        self._logged = state
        text = f"{state.name.lower()}: {message}" if message else state.name.lower()
        if state in (State.DISCONNECTED, State.FAULT):
            self.get_logger().error(text)
        else:
            self.get_logger().info(f"{text} ({self._driver.link.port.name})")

    # order ----------------------------------------------------------------------------------------------------

    def _park(self) -> None:
        """Drive to the park position, as far as the link and the time allow."""
        if not self._safety.can_move:
            return
        deadline = time.monotonic() + self._park_time_max
        self._safety.park(time.monotonic())
        while self._safety.can_move and not self._driver.at_rest:
            if time.monotonic() > deadline:
                angles = ", ".join(f"{angle:.3f}" for angle in self._driver.sent)
                self.get_logger().warning(
                    f"not parked within park_time_max {self._park_time_max:g} s: servos left at {angles} rad"
                )
                break
            time.sleep(self._period / 2)
            if self._driver.tick(time.monotonic()) and self.context.ok():
                self._publish_joint_states()
        if self.context.ok():
            self._publish_status()

    def _answer_bad_transitions(self) -> None:
        """Answer a transition that the state does not have with `success` false; rclpy would end the node."""
        service = self._service_change_state
        change = service.callback

        def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
            try:
                return change(request, response)
            except RuntimeError as error:  # RCLError, which rclpy does not export
                self.get_logger().warning(f"transition refused: {error}")
                response.success = False
                return response

        service.callback = answer


def make_driver(values: Mapping[str, Any]) -> Driver:
    """Build the driver that the parameters describe; raise ValueError, naming the parameter, if they are wrong."""
    start = values["start"]
    if start and len(start) != len(names.SERVOS):
        raise ValueError(f"parameter 'start' has {len(start)} values; it needs {len(names.SERVOS)}")
    if values["retry_max"] < values["retry_min"]:
        raise ValueError(
            f"parameter 'retry_max' is {values['retry_max']:g} s; allowed: at least retry_min {values['retry_min']:g} s"
        )
    if 0 < values["baud"] < SLOWEST:
        raise ValueError(f"parameter 'baud' is {values['baud']}; allowed: 0 or at least {SLOWEST}")
    calibration = read_calibration(Path(values["calibration"])) if values["calibration"] else Calibration()
    sessions = choose_sessions(values["protocol"], AngleMapping(values["angle_mapping"]), calibration)
    port = choose_port(
        values["port"],
        baud=values["baud"] or sessions[0].baud,
        boot_time=values["boot_time"],
        write_timeout=values["write_timeout"],
    )
    period = 1.0 / values["rate"]
    return Driver(
        Link(port, *sessions, retry_min=values["retry_min"], retry_max=values["retry_max"]),
        Safety(limits_from(values), *common_bounds(sessions), start=start or None, period=period),
        keep_alive=values["keep_alive"],
        period=period,
    )


def status_message(driver: Driver) -> RobotStatus:
    """Return the status of the driver, without a stamp."""
    safety = driver.safety
    return RobotStatus(
        state=safety.state,
        message=safety.message,
        port=driver.link.port.name,
        protocol=driver.link.session.name,
        joint_names=list(names.SERVOS),
        commanded=safety.commanded,
        sent=driver.sent,
        packets_sent=driver.packets_sent,
        bytes_sent=driver.bytes_sent,
        reconnects=driver.link.reconnects,
        rejected_commands=safety.rejected,
        last_rejection=safety.last_rejection,
    )


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


def seconds(duration: Duration) -> float:
    """Return a duration as a number [s]."""
    return float(duration.sec) + 1e-9 * float(duration.nanosec)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the driver until it is stopped; return the exit code of `run_node`."""
    return run_node("driver", DriverNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
