"""The driver as a lifecycle node: configure opens the port, activate allows motion, closing parks the servos."""

import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tripod_msgs.msg import RobotStatus

from tripod_driver.calibration_file import calibration_text
from tripod_driver.messages import imu_message, joint_fields, status_message
from tripod_driver.safety import State
from tripod_driver.settings import PARAMETERS, channel_joints, chosen_calibration, make_driver
from tripod_graph import diagnostic_keys as keys
from tripod_graph import names
from tripod_graph.control_mode import authority_values, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.follow_action import FollowAction
from tripod_graph.goal import Motion
from tripod_graph.limits import limits_from
from tripod_graph.liveliness import Rival
from tripod_graph.mode import Decision
from tripod_graph.motion_clock import STALLED, MotionClock
from tripod_graph.parameters import declare
from tripod_graph.qos import LATCHED, RELIABLE, SENSOR
from tripod_graph.rate_check import Turns, short
from tripod_graph.run import run_node
from tripod_graph.timers import set_period
from tripod_graph.trajectory import Command, obey

CLOCK = "use_sim_time"
"""Parameter of ROS that says from where a node takes the time."""

STATUS_PERIOD = 0.1
"""Longest time between two status messages [s]."""

TURN = 1.05
"""Time between two looks at what is due, in packet periods: a timer that is a little early finds its packet due."""

SOON = 0.003
"""A new command is looked at after this time [s], when it asks for a change, not only at the next packet's turn."""


class DriverNode(LifecycleNode):
    """Feeds `Driver` from the graph and publishes what it sends; the rules are there."""

    def __init__(self) -> None:
        super().__init__("driver")
        values = declare(self, PARAMETERS, self._adopt)
        self._driver = make_driver(values)
        self._safety = self._driver.safety
        self._clock_of_motion = MotionClock(self)
        self._safety.moment = self._clock_of_motion.at
        self._park_time_max = values["park_time_max"]
        self._shown: tuple[Any, ...] = ()
        self._logged: State | None = None
        self._warned, self._logged_incidents = "", 0
        self._turns = Turns()
        self._status_due = 0.0
        self._answer_bad_transitions()
        self.add_on_set_parameters_callback(
            self._check_clock
        )  # in front: it is asked before the clock is changed
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        topics = (names.ROBOT_JOINT_STATES, *([names.JOINT_STATES] if values["joint_states"] else []))
        self._joint_states = [self.create_publisher(JointState, topic, RELIABLE) for topic in topics]
        self._status = self.create_publisher(RobotStatus, names.ROBOT_STATUS, RELIABLE)
        self._rival = Rival(self, self._status)
        self._calibration = self.create_publisher(String, names.CALIBRATION, LATCHED)
        self._calibration.publish(String(data=calibration_text(chosen_calibration(values))))
        self._imu: Publisher | None = None  # until the board has told of one
        listen(self, self._on_decision)
        obey(self, self._follow, self._refuse)
        action = f"robot/{names.FOLLOW_JOINT_TRAJECTORY}"
        self._action = FollowAction(self, action, self._follow, self._motion, self._hold, self._refuse)
        self.create_service(Trigger, names.ROBOT_STOP, self._on_stop)
        self.create_service(Trigger, names.ROBOT_HOME, self._on_home)
        self._diagnostics = Diagnostics(self, self._report, values["port"])
        self._timer = self.create_timer(TURN * self._driver.period, self._on_turn, clock=steady)
        self._soon = self.create_timer(SOON, self._on_soon, clock=steady)
        self._soon.cancel()
        if values["autostart"]:
            self.trigger_configure()
            self.trigger_activate()

    def _adopt(self, values: Mapping[str, Any]) -> None:
        """Take rates, times and slew rates that have changed."""
        self._safety.adopt(limits_from(values, values["servos"], channel_joints(values["channels"])))
        self._driver.period, self._driver.keep_alive = 1.0 / values["rate"], values["keep_alive"]
        self._park_time_max = values["park_time_max"]
        set_period(self._timer, TURN * self._driver.period)

    def _check_clock(self, changes: list[Parameter]) -> SetParametersResult:
        """Refuse another clock while motion is allowed: the times of trajectories and stamps are those of one clock."""
        now = self.get_parameter(CLOCK).value
        if self._safety.is_active and any(c.name == CLOCK and c.value != now for c in changes):
            remedy = f"deactivate it first: ros2 lifecycle set {self.get_fully_qualified_name()} deactivate"
            reason = f"parameter '{CLOCK}' stays {now} while the driver is active; {remedy}"
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def leave(self) -> None:
        """Tell whose goal is followed that it ends."""
        self._action.leave()

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

    def _follow(self, command: Command) -> str:
        why = self._safety.trajectory(
            command.names,
            command.times,
            command.positions,
            command.now,
            source=command.source,
            velocities=command.velocities,
            efforts=command.efforts,
            age=command.age,
        )
        self._look_soon(command.now)
        return why

    def _motion(self) -> Motion:
        return self._safety.motion(time.monotonic())

    def _hold(self) -> None:
        self._safety.interrupt(time.monotonic(), "a goal ended early; the next command starts from here")

    def _refuse(self, error: ValueError) -> None:
        self._safety.reject(error)
        self.get_logger().warning(f"command refused: {error}", throttle_duration_sec=2.0)

    def _on_decision(self, decision: Decision) -> None:
        try:
            self._safety.control_mode(decision, *clocks(self))
        except ValueError as error:
            self._refuse(error)
        self._look_soon(time.monotonic())

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._safety.halt(time.monotonic())
        response.success, response.message = (
            True,
            "the servos hold their angles; change the control mode to move them again",
        )
        return response

    def _on_home(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        why = self._safety.home()
        done = "the winches look for home" if self._safety.homing else "each place is known"
        response.success, response.message = not why, why or done
        return response

    def _on_turn(self) -> None:
        self._turns.add()
        self._on_timer()

    def _on_timer(self) -> None:
        now = time.monotonic()
        self._clock_of_motion.at(now)
        if not self._clock_of_motion.stalled:
            self._safety.forget(STALLED)
        elif self._safety.state is State.ACTIVE:  # once: then it parks in time
            self._safety.interrupt(now, STALLED)
        if self._driver.tick(now):
            self._publish_joint_states(self._driver.sent)
        elif self._driver.too_early(now):
            self._look_soon(now)
        self._publish_imu()
        state, message = self._safety.state, self._safety.message
        shown = (state, message, self._safety.rejected)
        if shown != self._shown or now >= self._status_due:
            self._log_change(state, message)
            self._shown = shown
            due = min(self._status_due, now)  # looks are late, each by a little, and that does not add up
            self._status_due = max(due, now - STATUS_PERIOD) + STATUS_PERIOD
            self._publish_status()
            if self._safety.listens and not self._safety.can_move:  # nothing is sent
                self._publish_joint_states(self._safety.place)

    def _look_soon(self, now: float) -> None:
        """Let what is asked for at `now` [s] be sent as soon as its turn comes."""
        if self._soon.is_canceled():
            self._soon.timer_period_ns = round(1e9 * max(SOON, self._driver.turn(now)))
            self._soon.reset()

    def _on_soon(self) -> None:
        self._soon.cancel()
        self._timer.reset()  # the next turn is a turn after this look
        self._on_turn()

    def _publish_joint_states(self, values: Sequence[float]) -> None:
        joints = self._safety.joints
        message = JointState(name=[joint.name for joint in joints], **joint_fields(joints, values))
        message.header.stamp = self.get_clock().now().to_msg()
        for publisher in self._joint_states:
            publisher.publish(message)

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
        found, declared = self._turns.rate(time.monotonic()), 1.0 / (TURN * driver.period)
        late = short("the computer is too busy: rate of sending to the servos", found, declared)
        odd = driver.message or self._rival.notice or late
        level = Level.WARN if odd else Level.OK
        if self._in_trouble(safety.state):
            level = Level.ERROR
        return (
            level,
            odd or safety.state.name.lower(),
            {
                keys.STATE: safety.state.name,
                keys.CONNECTION_ERROR: driver.link.error,
                **authority_values(safety.authority),
                "port": driver.link.port.name,
                "protocol": session.name,
                "place of the servos": self._driver.place_source or "unknown",
                "place file": self._driver.memory.warning or self._driver.memory.path or "none",
                "packets sent": driver.packets_sent,
                "looks at what is to be sent [Hz]": found or 0.0,
                "reconnects": driver.link.reconnects,
                "rejected commands": safety.rejected,
                "last rejection": safety.last_rejection,
                **session.diagnostics,
            },
        )

    def _in_trouble(self, state: State) -> bool:
        return state is State.FAULT or (state is State.DISCONNECTED and self._driver.wanted)

    def _log_change(self, state: State, message: str) -> None:
        """Log a state that is new, and what the board did by itself; what is wrong at a level that is seen."""
        if (warning := self._driver.memory.warning) and warning != self._warned:
            self._warned = warning
            self.get_logger().warning(warning)
        if self._logged_incidents != self._driver.incidents:
            self._logged_incidents = self._driver.incidents
            self.get_logger().warning(self._driver.incident)
        if state is self._logged:
            return
        self._logged = state
        text = f"{state.name.lower()}: {message}" if message else state.name.lower()
        if self._in_trouble(state):
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
                pairs = zip(self._safety.joints, self._driver.sent, strict=True)
                values = ", ".join(
                    f"{value:.3f} rad" if joint.unit == "rad" else joint.shown(value)
                    for joint, value in pairs
                )
                self.get_logger().warning(
                    f"the park pose was not reached within park_time_max {self._park_time_max:g} s; the robot was left "
                    f"at {values}"
                )
                break
            time.sleep(self._driver.period / 2)
            if self._driver.tick(time.monotonic()) and self.context.ok():
                self._publish_joint_states(self._driver.sent)
        if self.context.ok():
            self._publish_status()

    def _answer_bad_transitions(self) -> None:
        """Answer a transition that the state does not have with `success` false; rclpy would end the node."""
        service = self._service_change_state
        change = service.callback

        def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
            try:
                return change(request, response)
            except RuntimeError:  # RCLError, which rclpy does not export
                asked, state = request.transition, self._state_machine.current_state[1]
                allowed = ", ".join(f"{one[0]} {one[1]}" for one in self._state_machine.available_transitions)
                self.get_logger().warning(
                    f"transition {asked.label or asked.id} is not possible in state {state}; allowed: {allowed}"
                )
                response.success = False
                return response

        service.callback = answer


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the driver until it is stopped; return the exit code of `run_node`."""
    return run_node("driver", DriverNode, arguments)


if __name__ == "__main__":
    sys.exit(main())
