"""The simulator as a node: parameters, conversions, one call; the physics runs in its own thread."""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger
from tripod_msgs.msg import Compliance, RobotStatus, SimStatus

from tripod_graph import names
from tripod_graph.command import Activity, CommandError, CommandFollower, CommandLimits
from tripod_graph.control_mode import authority_message, authority_values, clocks, listen
from tripod_graph.diagnostics import Diagnostics, Level, Report
from tripod_graph.executor import Patient
from tripod_graph.follow_action import FollowAction
from tripod_graph.goal import Motion, motion_of
from tripod_graph.joint import Joint
from tripod_graph.limits import limits_from
from tripod_graph.liveliness import Rival
from tripod_graph.mode import Decision, Mode, ModeTracker
from tripod_graph.motion_clock import STALLED, MotionClock
from tripod_graph.parameters import ParameterError, declare
from tripod_graph.qos import KEPT, LATCHED, NEWEST, RELIABLE
from tripod_graph.range import SILENT, Fence, RangeWatch, cut
from tripod_graph.rate_check import short
from tripod_graph.run import Companion, run_node
from tripod_graph.timers import set_period
from tripod_graph.trajectory import Command, obey
from tripod_host.arrays import FloatArray
from tripod_runtime import lag, messages, realtime
from tripod_runtime.hot_swap import HotSwap, Replacement
from tripod_runtime.introspection import Introspection
from tripod_runtime.notices import known, notices, stalls
from tripod_runtime.realtime import RealTime, Snapshot, Speed
from tripod_runtime.requests import Request, changed
from tripod_runtime.resimulation import Resimulation
from tripod_runtime.scene_topics import SceneTopics
from tripod_runtime.settings import PARAMETERS
from tripod_runtime.simulated_clock import SimulatedClock
from tripod_runtime.standard_services import StandardServices
from tripod_runtime.transforms import Transforms
from tripod_sim.effects import EFFECTS
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, naming_file, override_words
from tripod_sim.simulation import Simulation
from tripod_sim.tables.joints import Joints
from tripod_sim.tables.short_forms import effector_of
from tripod_study.summary.errors import effector_error, mesh_error
from tripod_study.summary.stability import snap_words

STATUS_PERIOD = 0.1
"""Time between two status messages [s]."""

REPEAT_PERIOD = 1.0
"""Time after which a state that no longer changes is published again, for who came late [s]."""


class SimNode(Node):
    """Feeds `RealTime` with the commands of the graph and publishes its snapshots."""

    def __init__(
        self, resimulation: Resimulation | None = None, *, rate: float = 1.0, begin: Replacement | None = None
    ) -> None:
        """Build the simulation.

        Args:
            resimulation: Make the steps of a recording again instead, `rate` times as fast.
            rate: See `resimulation`.
            begin: What takes the place of the simulation of another node; None: it builds its own.
        """
        super().__init__("sim")
        values = declare(self, PARAMETERS, self._adopt)
        self._hot_swap = HotSwap(self._refuse_hot_swap)
        self._source, self._overrides, self._changes = values["scene"], list[str](), list[str]()
        self._study = Path(values["study"]) if values["study"] else None
        simulation = resimulation.simulation if resimulation else self._build(values, begin)
        scene, self._resimulation = simulation.scene, resimulation
        self._logged = 0
        self._lock = threading.Lock()
        self._simulated = SimulatedClock(self, scene.dt) if values["publish_clock"] else None
        self._clock_of_motion = MotionClock(self)
        self._authority = ModeTracker()
        self._arms = simulation.joints
        self._limits = _within_scene(values, scene, self._arms)
        self._range = RangeWatch(self._limits)
        self._follower, self._fence = self._new_follower(), Fence()
        self._refused = 0
        self._last_refusal = self._robot_port = ""
        self._robot_at = -math.inf
        self._joint_topics = (
            names.SIM_JOINT_STATES,
            *([names.JOINT_STATES] if values["joint_states"] else []),
        )
        self._poses, self._joint_states = messages.PoseTeller(), messages.JointTeller(simulation.joints)
        self._join_graph(simulation)
        self._transforms = Transforms(self, scene, values["frame_prefix"]) if self._arms else None
        self._physics = RealTime(
            simulation,
            self._setpoint if resimulation is None else self._recorded,
            rate=rate,
            stamp=self._stamp,
            compliance_period=1 / values["compliance_rate"],
            on_snapshot=self._on_snapshot,
            on_reset=self._on_start_state,
        )
        source = scene.name if resimulation else values["scene"]
        self._introspection = Introspection(self, source, simulation, self._physics.latest, self._changes)
        self._introspection.publish_scene()
        if resimulation is None:
            self._introspection.hear(self, self._on_request, self._refuse)
        self._shown: Snapshot | None = None
        self._observed: Snapshot | None = None
        self._shown_at = 0.0
        self._pose_rate = values["pose_rate"]
        self._count_poses()
        self._body_timer = self.create_timer(
            1 / values["body_rate"], self._on_body_timer, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self.create_timer(STATUS_PERIOD, self._on_status_timer, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._diagnostics = Diagnostics(self, self._report)
        self._lag = self._watch_speed(values)
        self._introspection.standing = lambda: self._hot_swap.words or self._lag.hint(self._physics.speed())
        self._introspection.hands = self._hands_told
        sys.setswitchinterval(5e-4)  # the physics thread never waits long for the executor's
        self._physics.start()
        self.get_logger().info(
            f"scene {scene.name}: {len(simulation.mesh.nodes)} nodes, {simulation.mesh.count} elements, "
            f"dt {scene.dt:g} s"
        )
        self._log_notes()

    @property
    def replacement(self) -> Replacement | None:
        """The simulation that the next node of this process begins with; None until it is requested and built."""
        return self._hot_swap.ready

    def _build(self, values: dict[str, Any], begin: Replacement | None) -> Simulation:
        """Return the simulation that the parameters describe, or that of `begin`, which is that with changes."""
        self._overrides = override_words(values["set"])
        if values["accuracy"]:
            self._overrides = self._settle(values, self._overrides)
        if begin:
            self._changes = list(begin.changes)
            return begin.simulation
        scene = load_scene(self._source, self._overrides)
        try:
            with naming_file(self._source, self._overrides):
                simulation = Simulation(scene)
        except StepError as error:
            raise ParameterError(f"scene {scene.name!r} cannot start: {error}") from None
        simulation.rehearse()
        return simulation

    def _settle(self, values: dict[str, Any], overrides: list[str]) -> list[str]:
        """Return the overrides of the setting for an accuracy, and say what it is. Raises SceneError."""
        from tripod_study.accuracy.choice import choose  # noqa: PLC0415 - only where it is asked for

        choice = choose(values["scene"], values["accuracy"], overrides, study=self._study)
        self.get_logger().info(choice.sentence)
        return list(choice.overrides)

    def _adopt(self, values: Mapping[str, Any]) -> None:
        """Take rates and command limits that have changed."""
        limits = _within_scene(values, self._physics.simulation.scene, self._arms)
        with self._lock:
            self._limits = self._follower.limits = limits
            self._range.adopt(limits)
        self._pose_rate = values["pose_rate"]
        self._count_poses()
        self._physics.compliance_period = 1 / values["compliance_rate"]
        set_period(self._body_timer, 1 / values["body_rate"])

    def _count_poses(self) -> None:
        self._pose_every = max(1, round(1 / (self._pose_rate * self._physics.simulation.scene.dt)))

    def _watch_speed(self, values: Mapping[str, Any]) -> lag.LagMonitor:
        """Return what says that the steps are slower than real time; nothing has to be real time where time is
        simulated or a recording is played."""
        words = (*self._overrides, *self._changes)
        propose = partial(lag.proposal, self._source, words, study=self._study)
        monitor = lag.LagMonitor(propose, self.get_logger().warning)
        if not (values["publish_clock"] or self._resimulation):
            look = lambda: monitor.look(self._physics.speed(), time.monotonic())  # noqa: E731
            self.create_timer(lag.PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        return monitor

    def _join_graph(self, simulation: Simulation) -> None:
        self._topics = SceneTopics(self, simulation)
        self._joints = [self.create_publisher(JointState, topic, RELIABLE) for topic in self._joint_topics]
        self._pose = self.create_publisher(PoseStamped, names.EFFECTOR_POSE, RELIABLE)
        has_ball = simulation.scene.ball is not None
        self._ball = self.create_publisher(PoseStamped, names.SIM_BALL_POSE, RELIABLE) if has_ball else None
        self._compliance = self.create_publisher(Compliance, names.COMPLIANCE, RELIABLE)
        self._status = self.create_publisher(SimStatus, names.SIM_STATUS, RELIABLE)
        self._rival = Rival(self, self._status)
        self._commands = self.create_publisher(Float64MultiArray, names.COMMANDS, KEPT)
        self._applied = self.create_publisher(Float64MultiArray, names.APPLIED_FORCES, KEPT)
        self._checkpoint = self.create_publisher(UInt8MultiArray, names.CHECKPOINT, LATCHED)
        self._recorders = 0
        self._action: FollowAction | None = None
        if self._resimulation is None:  # what was commanded once is not commanded again
            listen(self, self._on_decision)
            self.create_subscription(
                RobotStatus, names.ROBOT_STATUS, self._on_robot_status, NEWEST, callback_group=Patient()
            )
            obey(self, self._follow, self._refuse)
            action = f"sim/{names.FOLLOW_JOINT_TRAJECTORY}"
            self._action = FollowAction(self, action, self._follow, self._motion, self._hold, self._refuse)
            self.create_service(Trigger, names.SIM_RESET, self._on_reset)
            self._standard = StandardServices(self, lambda: self._physics)
        self.create_service(SetBool, names.SIM_PAUSE, self._on_pause)
        self.create_service(Trigger, names.SIM_STEP, self._on_step)

    @property
    def failure(self) -> str:
        """Why the physics stands still for good, empty while it does not: the process then ends as failed."""
        return self._physics.failure

    @property
    def speeds(self) -> list[float]:
        """Slew rates of its joints without the slide [rad/s, m/s, N/s, Pa/s]."""
        return [float(speed) for speed in self._limits.speed[:-1]]

    def leave(self) -> None:
        """Tell whose goal is followed that it ends."""
        if self._action:
            self._action.leave()

    def close(self) -> None:
        """End the physics."""
        self._lag.close()
        self._hot_swap.close()
        self._physics.stop()

    def _new_follower(self) -> CommandFollower:
        start = tuple(self._arms.start.tolist()) if self._arms else self._limits.park
        return CommandFollower(self._limits, None if start == self._limits.park else start)

    # physics thread -------------------------------------------------------------------------------------------

    def _setpoint(self, now: float) -> FloatArray | None:
        if self._simulated:
            self._simulated.pass_by()
        if not self._arms:
            return None
        with self._lock:
            self._look(now)
            moment = self._moment(now)
            return self._fence.nearest(self._follower.setpoint(moment), self._range.limits, moment)

    def _moment(self, now: float) -> float:
        """Return the time by which commands move the joints [s] at the steady time `now` [s]."""
        return self._simulated.elapsed if self._simulated else self._clock_of_motion.at(now)

    def _stamp(self) -> int:
        return self._simulated.stamp if self._simulated else int(self.get_clock().now().nanoseconds)

    def _recorded(self, _: float) -> FloatArray | None:
        assert self._resimulation
        if self._simulated:
            self._simulated.pass_by()
        return self._resimulation.joints()

    def _on_snapshot(self, snapshot: Snapshot) -> None:
        self._introspection.keep(snapshot)
        if self._resimulation:
            self._resimulation.compare()
        if (c := messages.compliance_message(snapshot, self._arms)) is not None:
            self._compliance.publish(c)
        if snapshot.step % self._pose_every == 0:
            if snapshot.effector:
                self._pose.publish(self._poses.message(snapshot, snapshot.effector))
            if self._arms:
                told = self._joint_states.message(snapshot)
                for publisher in self._joints:
                    publisher.publish(told)
            if snapshot.ball and self._ball:
                self._ball.publish(self._poses.message(snapshot, snapshot.ball))

    def _on_start_state(self) -> None:
        self._introspection.reset(self._physics.latest)
        with self._lock:
            self._follower, self._fence = self._new_follower(), Fence()

    # executor -------------------------------------------------------------------------------------------------

    def _on_body_timer(self) -> None:
        snapshot = self._physics.latest
        now = time.monotonic()
        self._physics.watched, self._physics.wanted = self._introspection.is_watched, self._topics.wanted
        observed = self._physics.observed
        if observed and observed is not self._observed:
            self._observed = observed
            self._topics.publish_wanted(observed)
        if snapshot is self._shown:
            if now - self._shown_at < REPEAT_PERIOD:
                return
            if observed is snapshot:
                self._topics.publish_wanted(observed)
        self._shown, self._shown_at = snapshot, now
        self._publish_input_log()  # before the body to which it leads
        self._topics.publish(snapshot)
        if self._transforms:
            self._transforms.publish(snapshot)

    def _follow(self, command: Command) -> str:
        if not self._arms:
            raise CommandError(
                f"scene {self._physics.simulation.scene.name!r} has no actuators, so commands have no effect; "
                "take a scene with [servos], [[cable]], [[chamber]] or [[force]]"
            )
        with self._lock:
            self._look(command.now)
            if why := self._authority.admits(command.source, command.now):
                return why
            self._follower.accept(
                command.names,
                command.times,
                command.positions,
                self._moment(command.now),
                velocities=command.velocities,
                efforts=command.efforts,
                age=command.age,
                place=self._fence.place,
            )
        return ""

    def _motion(self) -> Motion:
        now = time.monotonic()
        with self._lock:
            self._look(now)  # while paused nothing else does
            why = self._physics.failure or self._authority.in_force
            return motion_of(self._follower, self._physics.latest.joints, self._moment(now), why)

    def _hold(self) -> None:
        with self._lock:
            self._follower.stop(self._moment(time.monotonic()))

    def _on_robot_status(self, message: RobotStatus) -> None:
        simulated = message.port == "mock" or message.state == RobotStatus.DISCONNECTED
        self._robot_port, self._robot_at = "" if simulated else message.port, time.monotonic()
        if self._robot_port and self._physics.rate not in (1.0, math.inf):
            self._set_speed(1.0)
            self._introspection.say(f"real time again: the robot on {self._robot_port} moves along")
        with self._lock:
            changed = self._range.hear(
                message.lower, message.upper, message.speed, time.monotonic(), message.joint_names
            )
        if changed and self._range.notice:
            self.get_logger().warning(self._range.notice)

    def _on_decision(self, decision: Decision) -> None:
        wall, now = clocks(self)
        try:
            with self._lock:
                if self._authority.hear(decision, wall, now):
                    self._obey(now)
        except ValueError as error:
            self._refuse(error)

    def _look(self, now: float) -> None:
        """Hold as the driver does, if nobody is there any more who commands; the caller has the lock."""
        if self._authority.lapse(now):
            self._obey(now)
        if self._follower.activity is Activity.ACTIVE and not self._authority.is_fed(now):
            self._follower.stop(self._moment(now))

    def _obey(self, now: float) -> None:
        """Hold, as the driver does, because something else is in force now."""
        if self._authority.mode is Mode.STOP:
            self._follower.stop(self._moment(now))
        else:
            self._follower.rest(self._moment(now))

    def _refuse(self, error: ValueError) -> None:
        self._refused += 1
        self._last_refusal = str(error)
        self.get_logger().warning(f"command refused: {error}", throttle_duration_sec=2.0)

    def _on_request(self, request: Request) -> None:
        """Do what a page asks; raise SceneError for what cannot be."""
        self._introspection.say("")
        match request.do:
            case "reset":
                self._physics.request_reset()
            case "pause" | "run":
                self._physics.pause(request.do == "pause")
            case "step":
                self._physics.request_steps()
            case "drop":
                self._physics.between_steps(self._drop_ball)
            case "speed":
                self._set_speed(request.speed)
            case "pull" | "let_go" | "load" | "unload":
                self._use_hands(request)
            case _:
                self._restart_with(request)

    def _set_speed(self, speed: float) -> None:
        """Run slower or faster than real time. Raises SceneError: a robot moves along, which cannot."""
        if speed != 1.0 and self._robot_port and time.monotonic() - self._robot_at <= SILENT:
            raise SceneError(
                f"the robot on {self._robot_port} moves in real time, so the simulation cannot run at {speed:g} times "
                "that; stop its driver first"
            )
        with self._lock:
            self._clock_of_motion.rate = speed
        self._physics.rate = speed

    def _hands_told(self) -> dict[str, Any]:
        """Return what figures tell of hands and speed."""
        hands, rate = self._physics.hands, self._physics.rate
        return {"hands": hands.words(), "stiffness": hands.stiffness, "speed": rate}

    def _use_hands(self, request: Request) -> None:
        hands, vector = self._physics.hands, np.array(request.vector)
        match request.do:
            case "pull":
                hold = np.array(request.hold)
                hands.pull(request.who, request.vertex, hold, vector, time.monotonic(), request.stiffness)
            case "load":
                hands.load(request.vertex, vector)
            case "let_go":
                hands.let_go(request.who)
            case _:
                hands.unload()

    def _drop_ball(self, simulation: Simulation) -> None:
        try:
            simulation.drop_ball()
            self._physics.request_checkpoint()  # what is recorded can be made again from here on
        except SceneError as error:
            self._introspection.say(str(error))

    def _restart_with(self, request: Request) -> None:
        """Have what is asked for built beside what runs. Raises SceneError."""
        changes, building = list[str](), self._hot_swap.changes
        now = self._changes if building is None else building
        if request.do == "effect":
            changes = changed(now, request)
        elif request.do == "accuracy":
            from tripod_study.accuracy.choice import switched  # noqa: PLC0415 - only where it is asked for

            effects = [w for w in now if w.partition("=")[0] in EFFECTS]
            words = [*self._overrides, *effects]
            changes = list(switched(self._source, request.accuracy, words, study=self._study).overrides)
        self._hot_swap.wish(self._source, self._overrides, changes)

    def _refuse_hot_swap(self, why: str) -> None:
        self._introspection.say(why)
        self.get_logger().warning(why)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._physics.request_reset()
        response.message = "back in the start state" if response.success else "the physics did not answer"
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._physics.pause(request.data)
        response.success = self._physics.activity is not realtime.Activity.FAILED
        response.message = self._physics.failure or ("paused" if request.data else "running")
        return response

    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        paused = self._physics.activity is realtime.Activity.PAUSED
        response.success = self._physics.request_steps() == 1
        if response.success:
            response.message = f"step {self._physics.latest.step}"
        else:
            late = "the physics did not answer" if paused else "not paused; call sim/pause first"
            response.message = self._physics.failure or late
        return response

    def _on_status_timer(self) -> None:
        self._physics.want_compliance = (
            effector_of(self._physics.simulation.scene) is not None
            and self._compliance.get_subscription_count() > 0
        )
        self._log_notes()
        self._publish_input_log()
        with self._lock:
            self._range.lapse(time.monotonic())
        self._status.publish(self._status_message())

    def _publish_input_log(self) -> None:
        """Publish what the steps were made with; who begins to record late gets a checkpoint to begin at."""
        recorders = self._checkpoint.get_subscription_count()
        if recorders > self._recorders:
            self._physics.request_checkpoint()
        self._recorders = recorders
        rows, forces = self._physics.input_log.take()
        if len(forces):  # first: they belong to these rows
            self._applied.publish(messages.applied_message(forces))
        if checkpoint := self._physics.take_checkpoint():  # first: it belongs before the last of the rows
            self._checkpoint.publish(messages.checkpoint_message(checkpoint))
        if len(rows):
            self._commands.publish(messages.commands_message(rows, self._arms))

    def _state(self) -> int:
        if self._physics.activity is realtime.Activity.FAILED:
            return int(SimStatus.FAILED)
        if self._physics.activity is realtime.Activity.PAUSED:
            return int(SimStatus.PAUSED)
        if self._resimulation or not self._arms or self._follower.activity is Activity.ACTIVE:
            return int(SimStatus.RUNNING)
        return int(SimStatus.HOLDING if self._follower.activity is Activity.HOLDING else SimStatus.PARKED)

    def _status_message(self) -> SimStatus:
        snapshot, speed = self._physics.latest, self._physics.speed()
        scene, energies, report = self._physics.simulation.scene, snapshot.energies, snapshot.report
        error, failure = report.time_error, self._physics.failure
        message = f"{failure}; call sim/reset" if failure else self._notices(snapshot, speed)
        return SimStatus(
            header=messages.header(self._stamp()), state=self._state(), message=message, scene=scene.name, dt=scene.dt,
            step=snapshot.step, time=snapshot.time, real_time_factor=speed.real_time_factor,
            capacity=scene.dt / speed.median if speed.median else 0.0, step_time_median=speed.median,
            step_time_p99=speed.p99, newton_iterations=report.iterations, halvings=report.halvings, parts=report.parts,
            time_error=known(error.largest if error else None),
            effector_time_error=known(error.effector if error else None),
            effector_mesh_error=known(mesh_error(report)), effector_error=known(effector_error(report)),
            residual=report.residual, kinetic_energy=energies.kinetic, strain_energy=energies.strain,
            gravity_energy=energies.gravity, missed_periods=speed.missed, rejected_commands=self._refused,
            last_rejection=self._last_refusal, authority=authority_message(self._authority),
            **self._told_joints(),
        )  # fmt: skip

    def _told_joints(self) -> dict[str, Any]:
        """Return the fields of the status about the joints, the slide left out."""
        joints = self._range.limits.table[:-1]
        return {
            "joint_names": [joint.name for joint in joints],
            "units": [joint.unit for joint in joints],
            "lower": [joint.low for joint in joints],
            "upper": [joint.high for joint in joints],
            "speed": [joint.speed for joint in joints],
        }

    def _log_notes(self) -> None:
        """Log the notes on the scene that are new: some come while it runs."""
        notes = self._physics.simulation.notes
        for note in notes[self._logged :]:
            self.get_logger().warning(note)
        self._logged = len(notes)

    def _notices(self, snapshot: Snapshot, speed: Speed) -> str:
        beyond = cut(self._follower.joints, self._range.limits) if self._arms else ""
        words = (
            notices(snapshot),
            *self._authority.notices(time.monotonic()),
            beyond,
            self._lag.words(speed),
            self._hot_swap.words,
            *self._physics.simulation.notes,
        )
        return "; ".join(word for word in words if word)

    def _too_seldom(self, factor: float) -> Iterator[str]:
        """Tell which topics of the steps come less often than declared, at a real-time factor."""
        scene = self._physics.simulation.scene
        poses = 1.0 / (self._pose_every * scene.dt)
        for topic, rate, told in (
            (names.SIM_JOINT_STATES, poses, self._arms),
            (names.EFFECTOR_POSE, poses, effector_of(scene)),
            (names.COMPLIANCE, 1.0 / self._physics.compliance_period, self._physics.want_compliance),
        ):
            if told and (words := short(topic, factor * rate, rate)):
                yield words

    def _report(self) -> Report:
        speed = self._physics.speed()
        values = {
            **authority_values(self._authority),
            "real-time factor": speed.real_time_factor,
            "median step [s]": speed.median,
            "missed": speed.missed,
        }
        if self._physics.failure:
            return Level.ERROR, self._physics.failure, values
        latest = self._physics.latest
        ignored = next(self._authority.notices(time.monotonic()), "")
        snap = (
            snap_words(*stability_margin)
            if (stability_margin := self._introspection.stability_margin)
            else ""
        )
        near = f"a snap is {snap}" if snap else ""
        still = STALLED if self._clock_of_motion.stalled else ""
        told = (stalls(latest), latest.report.instability, still, self._rival.notice, ignored, near)
        if trouble := next(filter(None, told), ""):
            return Level.WARN, trouble, values
        if slow := self._lag.words(speed):
            return Level.WARN, "; ".join([slow, *self._too_seldom(speed.real_time_factor)]), values
        running = self._physics.activity is realtime.Activity.RUNNING
        return Level.OK, "running" if running else "paused", values


def _within_scene(values: Mapping[str, Any], scene: Scene, joints: Joints | None) -> CommandLimits:
    """Return the limits that the parameters set, narrowed to what the scene allows.

    Raises ParameterError if nothing is left, CommandError if the park position is one of other joints.
    """
    if not joints:
        return limits_from(values)
    others = tuple(Joint(a.name, a.unit, a.low, a.high, np.inf) for a in joints.others)
    limits = limits_from(values, len(joints.arms), others)
    for arm in joints.arms:
        if not max(limits.angle_min, arm.low) < min(limits.angle_max, arm.high):
            raise ParameterError(
                f"parameters angle_min {limits.angle_min} and angle_max {limits.angle_max} rad allow no angle "
                f"of the scene, which has {arm.low} to {arm.high} rad: choose limits that overlap"
            )
    limits = replace(limits, slide_max=min(limits.slide_max, joints.slide_max))
    return limits.within(
        joints.low.tolist(), joints.high.tolist(), limits.speed[:-1].tolist(), limits.required
    )


def main(
    arguments: Sequence[str] | None = None,
    beside: Callable[[Executor, Sequence[float]], Companion] | None = None,
) -> int:
    """Run the node, and what `beside` makes with its executor and its slew rates; see `tripod_graph.run.run_node`."""
    made: list[SimNode] = []

    def make() -> SimNode:
        begin = made.pop().replacement if made else None
        made.append(SimNode(begin=begin))
        return made[0]

    def restarts() -> bool:
        return bool(made and made[0].replacement)

    def companion(executor: Executor) -> Companion:
        assert beside
        return beside(executor, made[0].speeds)

    return run_node(
        "sim", make, arguments, until=restarts, again=restarts, beside=companion if beside else None
    )


if __name__ == "__main__":
    sys.exit(main())
