"""What a scene says of the rows of data: the rest state of each commanded pose, or a motion stepped in time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.observe import Observer, Point, Sensor, plain_sensor, with_watched
from tripod_sim.build import build
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene, at_rest
from tripod_sim.simulation import Simulation
from tripod_sim.state import State
from tripod_sim.steps.parts import Parts
from tripod_sim.system import System
from tripod_sim.tables.short_forms import joints_of, posed

TOLERANCE = 1e-7
"""Unbalanced force to which states and steps are solved [N]: small against what a changed value makes."""

PLACES = 1e-7
"""Likewise the error that a step of a motion may have where one solve may do [m], see `tables/method.py`: what steps
differ by at 5e-6 m is as large as what a thousandth of a modulus makes, whose derivatives would be wrong by a half."""

MORE = 0.5
"""By which the servos may go beyond the range of the scene [rad], as their zeros are not known."""

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Told:
    """What is assumed of the robot besides the scene.

    Attributes:
        scene: With the values that are assumed.
        zero: Of the servos [rad], shape (s,): the arm stands at gain command + zero. Other joints have none.
        gain: Shape (s,).
        sensor: How the data see it.
        start: Time of the data at which a motion begins [s].
    """

    scene: Scene
    zero: FloatArray
    gain: FloatArray
    sensor: Sensor
    start: float = 0.0

    def joints(self, commands: FloatArray) -> FloatArray:
        """Return where the arms stand [rad], other joints and the slide [m], for commands of shape (k, a + 1)."""
        joints, servos = commands.copy(), slice(len(self.zero))
        joints[:, servos] = self.gain * commands[:, servos] + self.zero
        return joints


def plainly(scene: Scene) -> Told:
    """Return what is assumed where nothing is known: servos and sensor as the scene has them.

    Raises SceneError, see `check_servos`.
    """
    check_servos(scene)
    count = scene.servos.count if scene.servos else 0
    return Told(scene, np.zeros(count), np.ones(count), plain_sensor())


def check_servos(scene: Scene) -> None:
    """Raise SceneError where a body has servos of its own: data of two robots would need names for theirs."""
    if any(body.servos for body in scene.body):
        raise SceneError(
            f"scene {scene.name!r} has bodies with their own servos ([body.servos]); data can be compared "
            "with [servos] only: make a scene of that one robot"
        )


def still(scene: Scene) -> Scene:
    """Return the scene whose rest states are looked for: static, solved closely."""
    return closely(at_rest(scene))


def closely(scene: Scene) -> Scene:
    """Return a scene with a solver whose errors are small against what a changed value makes."""
    s = scene.solver
    return replace(
        scene,
        solver=replace(
            s, tolerance=min(s.tolerance, TOLERANCE), position_tolerance=min(s.position_tolerance, PLACES)
        ),
    )


class Rest:
    """The states of rest of one scene."""

    def __init__(
        self, scene: Scene, measured: Measured, points: Sequence[Point], progress: Progress | None = None
    ) -> None:
        """`progress`: told how far bodies are bent to fit together. Raises SceneError: there are no states of rest."""
        self.scene = still(with_watched(scene, points))
        if self.scene.prescribed:
            raise SceneError(
                "a scene with [[prescribed]] has no pose at rest; give the data a column t_s with the time"
            )
        self.parts: Parts = build(self.scene, progress)
        if not isinstance(self.parts.system, System):
            raise SceneError(
                f"scene {scene.name!r} has no solid with a stiffness, so it has no pose at rest; take one "
                "with [mesh] and [material]"
            )
        self.system: System = self.parts.system
        watched = {t.set: nodes for t, nodes in zip(self.scene.marker, self.parts.watched, strict=True)}
        self.observer = Observer(measured.channels, points, watched, self.system.rest)

    def start(self) -> State:
        """Return the state that a simulation begins from: bent, where bodies do not fit together undeformed."""
        return self.system.start_state(np.zeros(self.system.groups.joints))

    def settle(self, state: State, joints: FloatArray) -> None:
        """Bring a state to rest at `joints`, in place. Raises StepError; it is then as it was."""
        self.parts.stepper.forget()
        self.parts.stepper.step(state, joints, 0.0)


def rest_states(
    rest: Rest, joints: FloatArray, near: Sequence[State] | None = None, progress: Progress | None = None
) -> list[State]:
    """Return the state of rest of each row of `joints`, shape (k, a + 1), played in their order.

    Args:
        rest: The scene.
        joints: Commands of all joints, and the slide [m].
        near: States to begin from, one for each row, such as those of other values of the scene.
        progress: Told the share that is done.

    Raises:
        StepError: a pose has no equilibrium; the message has its number.
    """
    found: list[State] = []
    for k, goal in enumerate(joints):
        try:
            state = _from(rest, near[k], goal) if near else None
            if state is None:  # `start` may have to bend bodies: not before it is needed
                state = found[-1].copy() if found else rest.start()
                rest.settle(state, goal)
        except StepError as error:
            raise StepError(f"row {k + 1} of the data: {error}") from error
        found.append(state)
        if progress:
            progress((k + 1) / len(joints))
    return found


def _from(rest: Rest, near: State, goal: FloatArray) -> State | None:
    """Return the state of rest at `goal` that is reached from one of other values; None where none is."""
    state = near.copy()
    rest.system.drive(state, state.joints.copy())  # where these servos stand, not those of `near`
    try:
        rest.settle(state, goal)
    except StepError:
        return None
    return state


@dataclass(frozen=True, eq=False)
class Run:
    """A motion that was stepped.

    Attributes:
        told: With these values.
        times: Of the steps, from the beginning of the motion [s], shape (n,).
        raw: What was seen in the world, see `Observer.raw`, shape (n, sources, 2, 3).
        observer: Of the data.
    """

    told: Told
    times: FloatArray
    raw: FloatArray
    observer: Observer

    def serves(self, told: Told, measured: Measured) -> bool:
        """Return whether the same motion, seen by another sensor or begun at another time, is that of `told`."""
        own = self.told
        same = (
            own.scene == told.scene
            and np.array_equal(own.zero, told.zero)
            and np.array_equal(own.gain, told.gain)
        )
        same &= np.array_equal(own.sensor.mount, told.sensor.mount)
        same &= own.start == told.start or not joints_of(told.scene)
        assert measured.times is not None
        return bool(same and measured.times[-1] - told.start <= self.times[-1])

    def at(self, told: Told, measured: Measured) -> FloatArray:
        """Return what the data would be [m, rad], shape (k, m)."""
        assert measured.times is not None
        times = np.maximum(measured.times - told.start, 0.0)
        flat = self.raw.reshape(len(self.times), -1)
        rows = np.column_stack([np.interp(times, self.times, column) for column in flat.T])
        return self.observer.framed(rows.reshape(-1, *self.raw.shape[1:]), told.sensor)


def run_motion(
    told: Told, measured: Measured, points: Sequence[Point], progress: Progress | None = None, further: float = 0.0
) -> Run:  # fmt: skip
    """Return the motion of a scene until the end of the data, and `further` [s].

    Commands are joined by straight lines; the scene begins in its first pose.

    Raises:
        SceneError: the scene cannot be stepped.
        StepError: the motion broke off.
    """
    assert measured.times is not None
    scene = with_watched(told.scene, points)
    if not scene.inertia:
        raise SceneError(
            f"scene {scene.name!r} has no [inertia], so it has no motion in time; --poses takes each row "
            "as a pose at rest"
        )
    commands = told.joints(measured.joints(scene))
    if s := scene.servos:
        low, high = max(s.angle_min - MORE, -3.2), min(s.angle_max + MORE, 3.2)
        scene = replace(scene, servos=replace(s, angle_min=low, angle_max=high))
    commanded = joints_of(scene) is not None
    if commanded:
        scene = posed(scene, commands[0, :-1], float(commands[0, -1]))
    simulation = Simulation(scene)
    observer = Observer(measured.channels, points, simulation.watched, simulation.mesh.nodes)
    steps = int(np.ceil(max(measured.times[-1] - told.start + further, 0.0) / scene.dt - 1e-9))
    seen = [observer.raw(simulation.state, told.sensor.mount)]
    for i in range(1, steps + 1):
        joints = None
        if commanded:
            at = told.start + i * scene.dt
            joints = np.array([np.interp(at, measured.times, column) for column in commands.T])
        if unstable := simulation.step(joints).instability:
            raise StepError(unstable)
        seen.append(observer.raw(simulation.state, told.sensor.mount))
        if progress:
            progress(i / steps)
    times = np.asarray(np.arange(steps + 1) * scene.dt, dtype=np.float64)
    return Run(told, times, np.array(seen), observer)


def motion(
    told: Told, measured: Measured, points: Sequence[Point], progress: Progress | None = None
) -> FloatArray:
    """Return what a motion shows at the times of the data [m, rad], shape (k, m). Raises as `run_motion`."""
    return run_motion(told, measured, points, progress).at(told, measured)


def predict(
    told: Told, measured: Measured, points: Sequence[Point], progress: Progress | None = None
) -> FloatArray:
    """Return what the scene says of each row of data [m, rad], shape (k, m).

    Raises SceneError, StepError, DataError.
    """
    check_points(told.scene, points)
    if measured.times is not None:
        return motion(told, measured, points, progress)
    rest = Rest(told.scene, measured, points, progress)
    states = rest_states(rest, told.joints(measured.joints(told.scene)), progress=progress)
    return np.array([rest.observer.see(state, told.sensor) for state in states])


def check_points(scene: Scene, points: Sequence[Point]) -> None:
    """Raise DataError where two sources have one name."""
    names = [p.name for p in points]
    for name in names:
        if names.count(name) > 1 or name in {marker.set for marker in scene.marker} or name == "effector":
            raise DataError(f"--point {name!r}: the name is already used; choose another")
