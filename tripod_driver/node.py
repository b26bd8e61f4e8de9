"""The driver as a lifecycle node: configure opens the port, activate allows motion, closing parks the servos."""

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Duration
from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from tripod_msgs.msg import ControlMode, RobotStatus

from tripod_driver.driver import Driver, DriverState
from tripod_driver.link import Link
from tripod_driver.ports.choose import CHOICES, choose_port
from tripod_driver.protocol import AngleMapping, LegacyProtocol
from tripod_graph import names
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.limits import LIMIT_PARAMETERS, limits_from
from tripod_graph.parameters import Parameter, declare
from tripod_graph.qos import LATCHED_OF_ALL, RELIABLE
from tripod_graph.run import run_node

STATUS_PERIOD = 0.1
"""Longest time between two status messages [s]."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("port", "auto", f"Where the servos are: {CHOICES}"),
    Parameter("baud", 115200, "Speed of a serial port, in bits a second", low=1200, high=4_000_000),
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
        "Angle to byte: to the nearest degree, or as the workshop's program does",
        choices=tuple(mapping.value for mapping in AngleMapping),
    ),
    Parameter("rate", 50.0, "Largest number of packets a second", "Hz", low=5.0, high=50.0),
    Parameter(
        "keep_alive", 0.1, "Time after which an unchanged packet is sent again", "s", low=0.02, high=60.0
    ),
    Parameter(
        "start",
        [],
        "Angles of the three servos when the driver starts; unset means the park position. The board cannot be "
        "asked; the workshop's program leaves them at -0.5236",
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
        self._period = 1.0 / values["rate"]
        self._park_time_max = values["park_time_max"]
        self._shown: tuple[Any, ...] = ()
        self._logged: DriverState | None = None
        self._status_due = 0.0
        self._answer_bad_transitions()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._joint_states = self.create_publisher(JointState, names.ROBOT_JOINT_STATES, RELIABLE)
        self._status = self.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
        # first the mode: the executor takes what waits in this order, and a command may follow its mode at once
        self.create_subscription(ControlMode, names.CONTROL_MODE, self._on_control_mode, LATCHED_OF_ALL)
        self.create_subscription(JointTrajectory, names.JOINT_TRAJECTORY, self._on_trajectory, RELIABLE)
        self.create_service(Trigger, names.ROBOT_STOP, self._on_stop)
        self._diagnostics = Diagnostics(self, self._report, values["port"])
        self.create_timer(self._period, self._on_timer, clock=steady)
        if values["autostart"]:
            self.trigger_configure()
            self.trigger_activate()

    def close(self) -> None:
        """Park within `park_time_max`, then close the port, also when parking failed."""
        try:
            self._park()
        finally:
            self._driver.disconnect()

    # lifecycle ------------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the port; a port that is not there is no failure: the driver keeps trying."""
        self._driver.connect()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Allow motion."""
        self._driver.activate(time.monotonic())
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Hold and send nothing more."""
        self._driver.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Close the port."""
        self._driver.disconnect()
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
            self._driver.trajectory(message.joint_names, times, positions, time.monotonic())
        except ValueError as error:
            self.get_logger().warning(f"command refused: {error}", throttle_duration_sec=2.0)

    def _on_control_mode(self, message: ControlMode) -> None:
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        try:
            self._driver.control_mode(message.mode, stamp, time.monotonic())
        except ValueError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=2.0)

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._driver.halt(time.monotonic())
        response.success, response.message = True, "holding; change the control mode to go on"
        return response

    def _on_timer(self) -> None:
        now = time.monotonic()
        if self._driver.tick(now):
            self._publish_joint_states()
        shown = (self._driver.state, self._driver.message, self._driver.rejected)
        if shown != self._shown or now >= self._status_due:
            self._log_change(self._driver.state, self._driver.message)
            self._shown, self._status_due = shown, now + STATUS_PERIOD
            self._publish_status()

    def _publish_joint_states(self) -> None:
        message = JointState(name=list(names.SERVOS), position=self._driver.sent)
        message.header.stamp = self.get_clock().now().to_msg()
        self._joint_states.publish(message)

    def _publish_status(self) -> None:
        message = status_message(self._driver)
        message.header.stamp = self.get_clock().now().to_msg()
        self._status.publish(message)

    def _report(self) -> Report:
        driver = self._driver
        level = Level.WARN if driver.message else Level.OK
        if driver.state is DriverState.DISCONNECTED:
            level = Level.ERROR
        return (
            level,
            driver.message or driver.state.name.lower(),
            {
                "state": driver.state.name,
                "control mode": driver.mode.name,
                "port": driver.link.port.name,
                "protocol": driver.protocol.name,
                "packets sent": driver.packets_sent,
                "reconnects": driver.link.reconnects,
                "rejected commands": driver.rejected,
                "last rejection": driver.last_rejection,
            },
        )

    def _log_change(self, state: DriverState, message: str) -> None:
        """Log a state that is new; a link that goes or comes at a level that is seen."""
        if state is self._logged:
            return
        self._logged = state
        text = f"{state.name.lower()}: {message}" if message else state.name.lower()
        if state is DriverState.DISCONNECTED:
            self.get_logger().error(text)
        else:
            self.get_logger().info(f"{text} ({self._driver.link.port.name})")

    # order ----------------------------------------------------------------------------------------------------

    def _park(self) -> None:
        """Drive to the park position, as far as the link and the time allow."""
        if not self._driver.can_move:
            return
        deadline = time.monotonic() + self._park_time_max
        self._driver.park(time.monotonic())
        while self._driver.can_move and not self._driver.at_rest:
            if time.monotonic() > deadline:
                angles = ", ".join(f"{angle:.3f}" for angle in self._driver.sent)
                self.get_logger().warning(
                    f"not parked within park_time_max {self._park_time_max:g} s: servos left at {angles} rad"
                )
                break
            time.sleep(self._period)
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
    port = choose_port(
        values["port"],
        baud=values["baud"],
        boot_time=values["boot_time"],
        write_timeout=values["write_timeout"],
    )
    return Driver(
        Link(port, retry_min=values["retry_min"], retry_max=values["retry_max"]),
        LegacyProtocol(AngleMapping(values["angle_mapping"])),
        limits_from(values),
        start=start or None,
        keep_alive=values["keep_alive"],
        period=1.0 / values["rate"],
    )


def status_message(driver: Driver) -> RobotStatus:
    """Return the status of the driver, without a stamp."""
    return RobotStatus(
        state=driver.state,
        message=driver.message,
        port=driver.link.port.name,
        protocol=driver.protocol.name,
        joint_names=list(names.SERVOS),
        commanded=driver.commanded,
        sent=driver.sent,
        packets_sent=driver.packets_sent,
        bytes_sent=driver.bytes_sent,
        reconnects=driver.link.reconnects,
        rejected_commands=driver.rejected,
        last_rejection=driver.last_rejection,
    )


def seconds(duration: Duration) -> float:
    """Return a duration as a number [s]."""
    return float(duration.sec) + 1e-9 * float(duration.nanosec)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the driver until it is stopped; return the exit code of `run_node`."""
    return run_node("driver", DriverNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
