"""The services of simulation_interfaces, as programs know them that work with any simulator."""

from collections.abc import Callable
from typing import Any, Final

from rclpy.node import Node
from simulation_interfaces.msg import Result, SimulationState, SimulatorFeatures
from simulation_interfaces.srv import (
    GetSimulationState,
    GetSimulatorFeatures,
    ResetSimulation,
    SetSimulationState,
    StepSimulation,
)

from tripod_graph import names
from tripod_runtime.realtime import Activity, RealTime

STEPS_TIME: Final = 2.0
"""Longest time of a call that steps [s]: as long the node hears nothing else."""

FEATURES: Final = (
    SimulatorFeatures.SIMULATION_RESET,
    SimulatorFeatures.SIMULATION_STATE_GETTING,
    SimulatorFeatures.SIMULATION_STATE_SETTING,
    SimulatorFeatures.SIMULATION_STATE_PAUSE,
    SimulatorFeatures.STEP_SIMULATION_SINGLE,
    SimulatorFeatures.STEP_SIMULATION_MULTIPLE,
)

Scope = ResetSimulation.Request
WHOLE: Final = Scope.SCOPE_TIME | Scope.SCOPE_STATE
SCOPES: Final = (Scope.SCOPE_DEFAULT, WHOLE, WHOLE | Scope.SCOPE_SPAWNED, Scope.SCOPE_ALL)
"""What can be reset: all at once; nothing is ever spawned."""

State = SimulationState
Answer = tuple[int, str]
"""Code and what to say."""

DONE: Final[Answer] = (Result.RESULT_OK, "")


class StandardServices:
    """Answers for a node, which keeps the object; `physics`: the thread, once it is there."""

    def __init__(self, node: Node, physics: Callable[[], RealTime]) -> None:
        self._physics = physics
        self._stopped = False
        for kind, name, answer in (
            (GetSimulatorFeatures, names.SIM_FEATURES, self._on_features),
            (GetSimulationState, names.SIM_GET_STATE, self._on_get_state),
            (ResetSimulation, names.SIM_STANDARD_RESET, self._answering(self._reset)),
            (StepSimulation, names.SIM_STANDARD_STEP, self._answering(self._step)),
            (SetSimulationState, names.SIM_SET_STATE, self._answering(self._set_state)),
        ):
            node.create_service(kind, name, answer)

    @staticmethod
    def _answering(act: Callable[[Any], Answer]) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            response.result.result, response.result.error_message = act(request)
            return response

        return answer

    @staticmethod
    def _on_features(_: object, response: GetSimulatorFeatures.Response) -> GetSimulatorFeatures.Response:
        response.features.features = list(FEATURES)
        response.features.custom_info = "tripod has one scene; nothing can be added while it runs"
        return response

    def _on_get_state(self, _: object, response: GetSimulationState.Response) -> GetSimulationState.Response:
        response.state.state = self._state()
        failure = self._physics().failure
        response.result.result = Result.RESULT_OPERATION_FAILED if failure else Result.RESULT_OK
        response.result.error_message = failure
        return response

    def _state(self) -> int:
        physics = self._physics()
        if physics.activity is Activity.RUNNING:
            self._stopped = False
            return int(State.STATE_PLAYING)
        still = self._stopped and physics.latest.step == 0
        return int(State.STATE_STOPPED if still else State.STATE_PAUSED)

    def _reset(self, request: ResetSimulation.Request) -> Answer:
        if request.scope not in SCOPES:
            allowed = ", ".join(map(str, SCOPES))
            return (
                Result.RESULT_FEATURE_UNSUPPORTED,
                (
                    f"scope {request.scope} is not supported, as time and state are reset together; allowed: "
                    f"{allowed}"
                ),
            )
        if self._physics().request_reset():
            return DONE
        return Result.RESULT_OPERATION_FAILED, "the physics did not answer"

    def _step(self, request: StepSimulation.Request) -> Answer:
        physics = self._physics()
        if physics.activity is not Activity.PAUSED:
            return (
                Result.RESULT_INCORRECT_STATE,
                physics.failure or "not paused: set state 2 (paused) first",
            )
        if request.steps == 0:
            return Result.RESULT_OPERATION_FAILED, "steps is 0; allowed: at least 1"
        made = physics.request_steps(request.steps, STEPS_TIME)
        if made == request.steps:
            return DONE
        why = physics.failure or (
            f"{made} of {request.steps} steps were made in {STEPS_TIME:g} s, the time limit; request "
            "fewer steps"
        )
        return Result.RESULT_OPERATION_FAILED, why

    def _set_state(self, request: SetSimulationState.Request) -> Answer:
        physics, wanted = self._physics(), request.state.state
        if wanted not in (State.STATE_STOPPED, State.STATE_PLAYING, State.STATE_PAUSED):
            known = "0 (stopped), 1 (playing), 2 (paused)"
            return Result.RESULT_FEATURE_UNSUPPORTED, f"state {wanted} cannot be set; allowed: {known}"
        if wanted == self._state():
            return SetSimulationState.Response.ALREADY_IN_TARGET_STATE, ""
        if physics.failure and wanted != State.STATE_STOPPED:
            return SetSimulationState.Response.STATE_TRANSITION_ERROR, f"{physics.failure}; call sim/reset"
        if wanted == State.STATE_STOPPED:
            if physics.failure:
                physics.request_reset()  # which ends a failure, and goes on
            physics.pause(paused=True)
            if not physics.request_reset():
                return SetSimulationState.Response.STATE_TRANSITION_ERROR, "the physics did not answer"
        else:
            physics.pause(wanted == State.STATE_PAUSED)
        self._stopped = wanted == State.STATE_STOPPED
        return DONE
