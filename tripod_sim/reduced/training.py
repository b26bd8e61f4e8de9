"""Training: the full model in many poses and motions.

Poses are static: slides from 0 to the largest, angles within `spread` of the line from the flat to the working pose, on
which the strips stay stretched. In each pose the tangent tells how the body yields to forces and moments on the
effector and to the servos. Motions are fast moves of single servos, with inertia.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tripod_sim.build import build
from tripod_sim.errors import SceneError, StepError
from tripod_sim.linear.solver import LinearError
from tripod_sim.reduced.basis import free_rows
from tripod_sim.reduced.coordinates import Coordinates
from tripod_sim.scene import Scene
from tripod_sim.state import State
from tripod_sim.system import System
from tripod_sim.tables.method import Reduced, Solver
from tripod_sim.tables.motion import Damping, Inertia
from tripod_sim.tables.robot import Servos

FloatArray = NDArray[np.float64]

FORCE, TURN = 0.01, 0.005
"""Of the loads on the effector [N] (the moments have the disc's radius as lever) and of the servos' turns [rad] whose
first-order responses are learned."""

MOTIONS, RISE, QUIET, STEP = 6, 0.03, 0.06, 0.005
"""Number of fast moves, how long each lasts, how long the body then swings freely, and the step [s]."""


@dataclass(frozen=True, eq=False)
class Snapshots:
    """What training has seen.

    Attributes:
        moves: Displacements of free nodes [m], shape (3 f, k), poses first.
        boundary: Coordinates but q, shape (boundary, k).
        rates: First-order responses of free nodes [m], shape (3 f, l).
        boundary_rates: Of the coordinates but q, shape (boundary, l).
        poses: The static states.
    """

    moves: FloatArray
    boundary: FloatArray
    rates: FloatArray
    boundary_rates: FloatArray
    poses: tuple[State, ...]


def training_scene(scene: Scene) -> Scene:
    """Return what of a scene training depends on, as a static scene at its flat pose."""
    assert scene.servos
    return replace(
        scene, name="training", description="", dt=STEP, duration=1.0, inertia=None, damping=None,
        servo_dynamics=None, servos=replace(scene.servos, angles=(0.0, 0.0, 0.0), slide=0.0), reduced=None,
        solver=Solver(tolerance=1e-7),
    )  # fmt: skip


def poses(reduced: Reduced, servos: Servos) -> FloatArray:
    """Return the joints of training, in the order in which they are reached, shape (samples, 4).

    A third of the poses lies at the largest slide, with every second one at a corner of the range of angles.
    """
    rng = np.random.default_rng(reduced.seed)
    count = reduced.samples
    share = np.sort((np.arange(count) + rng.uniform(size=count)) / count * 1.5)
    away = rng.uniform(-1.0, 1.0, (count, 3))
    full = np.flatnonzero(share >= 1.0)
    share[full] = 1.0
    corners = full[::2]
    away[corners] = np.sign(away[corners])
    angles = np.clip(
        share[:, None] * reduced.angle + reduced.spread * away, servos.angle_min, servos.angle_max
    )
    return np.column_stack([angles, share * reduced.slide])


def outside(reduced: Reduced, joints: FloatArray) -> str:
    """Return in words where `joints`, angles [rad] and slide [m], are beyond the poses of training; empty if not."""
    angles, slide = joints[:-1], float(joints[-1])
    if reduced.slide > 0:
        share = min(max(slide / reduced.slide, 0.0), 1.0)
    else:
        share = min(max(float(angles.mean()) / reduced.angle, 0.0), 1.0) if reduced.angle else 0.0
    low, high = share * reduced.angle - reduced.spread, share * reduced.angle + reduced.spread
    found = [
        f"servo_{i} at {a:.3f} rad (trained {low:.3f} to {high:.3f})"
        for i, a in enumerate(angles.tolist())
        if not low - 1e-9 <= a <= high + 1e-9
    ]
    if slide > reduced.slide + 1e-9:
        found.append(f"slide at {slide:.4g} m (trained to {reduced.slide:.4g})")
    return f"reduced model beyond its training, less accurate: {', '.join(found)}" if found else ""


def take(scene: Scene, progress: Callable[[float], None]) -> Snapshots:
    """Return what the full model of `scene` does in training.

    Args:
        scene: With `reduced`, servos and effector.
        progress: Called with the finished fraction.

    Raises:
        SceneError: the full model finds an equilibrium in less than half of the poses, or not in the flat one.
    """
    assert scene.reduced
    assert scene.servos
    still = training_scene(scene)
    parts = build(still)
    system = parts.system
    assert isinstance(system, System)
    wanted = poses(scene.reduced, scene.servos)
    recorder = _Recorder(system)
    state = system.start_state(np.zeros(4))
    try:
        parts.stepper.step(state, np.zeros(4), 0.0)
    except StepError as error:
        raise SceneError(f"reduced: the full model finds no equilibrium in the flat pose: {error}") from error
    reached: list[State] = []
    for k, joints in enumerate(wanted):
        progress(0.9 * k / len(wanted))
        try:
            parts.stepper.step(state, joints, 0.0)
            recorder.add_rates(state)
        except (StepError, LinearError):
            continue
        recorder.add(state)
        reached.append(state.copy())
    if 2 * len(reached) < len(wanted):
        raise SceneError(
            f"reduced: the full model finds an equilibrium in {len(reached)} of {len(wanted)} poses of training; "
            "reduce reduced.spread, or set reduced.angle and reduced.slide to a pose that it reaches"
        )
    for k, moving in enumerate(_motions(still, reached[-1], scene.reduced)):
        progress(0.9 + 0.1 * k / (MOTIONS * (RISE + QUIET) / STEP))
        recorder.add(moving)
    return recorder.snapshots(tuple(reached))


def _motions(still: Scene, start: State, reduced: Reduced) -> Iterator[State]:
    """Yield states of fast moves about the pose of the largest slide; a move that fails is left out."""
    parts = build(replace(still, inertia=Inertia("tr_bdf2"), damping=Damping(), solver=Solver()))
    assert still.servos
    rng, state = np.random.default_rng([reduced.seed, 1]), start.copy()
    rise = round(RISE / STEP)
    for _ in range(MOTIONS):
        begin = state.joints.copy()
        turn = reduced.spread * rng.uniform(-1.0, 1.0, 3)
        turn[rng.integers(3)] = 0.0
        end = np.append(
            np.clip(reduced.angle + turn, still.servos.angle_min, still.servos.angle_max), begin[-1]
        )
        for k in range(round((RISE + QUIET) / STEP)):
            part = min(1.0, (k + 1) / rise)
            try:
                parts.stepper.step(state, begin + part * (end - begin), STEP)
            except StepError:
                break
            yield state


class _Recorder:
    """Collects snapshots of one system."""

    def __init__(self, system: System) -> None:
        self._system, self._rows = system, free_rows(system.groups)
        self._rest = system.rest.reshape(-1)[self._rows]
        centres = np.array([system.rest[b].mean(axis=0) for b in system.groups.rigid]).reshape(-1, 3)
        self._coordinates = Coordinates(centres, len(system.groups.driven), 0)
        self._moves: list[FloatArray] = []
        self._boundary: list[FloatArray] = []
        self._rates: list[FloatArray] = []
        self._boundary_rates: list[FloatArray] = []

    def add(self, state: State) -> None:
        """Record the displacements of `state`."""
        self._moves.append(state.positions.reshape(-1)[self._rows] - self._rest)
        z = self._coordinates.boundary_values(state.centres, state.rotations, state.joints)
        self._boundary.append(z)

    def add_rates(self, state: State) -> None:
        """Record the first-order responses about `state`. Raises LinearError where there are none."""
        system, coordinates = self._system, self._coordinates
        if system.assemble(state, project=False) >= 0:
            return
        system.evaluate(state)
        if not system.factor():
            return
        coordinates.update(state.rotations, state.joints)
        first, count = 3 * system.reduction.free_count, 6 * coordinates.bodies
        lever = system.lever[system.groups.rigid[0]] if count else np.ones((1, 3))
        radius = float(np.sqrt((lever**2).sum(axis=1).mean()))
        dx = np.zeros_like(system.rest)
        for k in range(count + coordinates.servos):
            b = np.zeros(system.unknowns)
            drive = np.zeros(coordinates.boundary)
            if k < count:
                b[first + k] = FORCE * (1.0 if k % 6 < 3 else radius)
            else:
                b -= TURN * system.reduction.drive[:, k - count]
                drive = TURN * coordinates.drive[:, k - count]
            answer = system.linear.solve(b)
            system.reduction.moves(answer, system.lever, dx)
            self._rates.append(dx.reshape(-1)[self._rows])
            self._boundary_rates.append(drive + coordinates.tangent @ answer[first:])

    def snapshots(self, reached: tuple[State, ...]) -> Snapshots:
        """Return all of them."""
        parts = (self._moves, self._boundary, self._rates, self._boundary_rates)
        moves, boundary, rates, boundary_rates = (np.array(part).T for part in parts)
        return Snapshots(moves, boundary, rates, boundary_rates, reached)
