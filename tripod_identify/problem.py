"""What the rows of data would be for given values, and how they answer to these.

At rest the states x solve g(x; p) = 0 with the tangent A = dg/dx, so that

    dx/dp = dx_d/dp - A^-1 dg/dp,

x_d being what the servos drive and dg/dp the change of the unbalanced forces with it: a difference of two evaluations
at one state, solved with the factorisation of that state. In motion whole runs are compared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_identify.errors import DataError
from tripod_identify.measured import Measured
from tripod_identify.model import Progress, Rest, Run, Told, check_points, closely, rest_states, run_motion
from tripod_identify.observe import Point
from tripod_identify.parameters import START, Parameter, told
from tripod_sim.errors import SceneError, StepError
from tripod_sim.state import State
from tripod_sim.system import System

STEP = 1e-6
"""Change of u for the difference of forces at rest: what it leaves out is a millionth, rounding less."""

RUN_STEP = 1e-3
"""The same for a difference of motions, whose steps are solved to a tolerance."""

BEFORE = 0.1
"""A motion whose start is looked for is stepped for so much longer [s]: it may begin so much earlier."""

KEPT = 2
"""Sets of values whose states are kept: the last, and the one before a step that is refused."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The rows for one set of values.

    Attributes:
        told: The values.
        values: [m, rad], shape (k, m).
        rest, states: Of poses at rest; None and empty for a motion.
    """

    told: Told
    values: FloatArray
    rest: Rest | None = None
    states: tuple[State, ...] = ()


class Problem:
    """Predictions for data, and their derivatives, over u (see `parameters`).

    Attributes:
        base: What is assumed besides the parameters.
        wanted: The parameters, p of them.
        measured: The data.
        points: Of the body, that the data know.
        evaluations: Times that all rows were computed.
    """

    def __init__(
        self, base: Told, wanted: Sequence[Parameter], measured: Measured, points: Sequence[Point],
        progress: Progress | None = None,
    ) -> None:  # fmt: skip
        """`progress`: told the share of the rows that is done, each time again.

        Raises DataError where a value has nothing to do with the data.
        """
        check_points(base.scene, points)
        names = [p.name for p in wanted]
        if measured.slide is not None and "servos.slide" in names:
            raise DataError(
                "--fit servos.slide: the data have a column for the slide, which sets it; leave out one of "
                "the two"
            )
        moving = [n for n in names if n.split(".")[0] in ("damping", "inertia") or n == START]
        if measured.times is None and moving:
            raise DataError(
                f"--fit {moving[0]}: the data are poses at rest, which do not depend on it; give the data a "
                "column t_s, or leave it out"
            )
        self.base, self.wanted, self.measured, self.points = base, tuple(wanted), measured, tuple(points)
        self.evaluations = 0
        self._progress = progress
        self._kept: dict[bytes, Solved] = {}
        self._near: tuple[State, ...] = ()
        self._runs: list[Run] = []
        self._slope: tuple[bytes, FloatArray] | None = None

    def start(self) -> FloatArray:
        """Return u where the fit begins, shape (p,)."""
        return np.array([p.to_u(p.value) for p in self.wanted])

    def at(self, u: FloatArray) -> Solved:
        """Return the rows at `u`. Raises SceneError, StepError."""
        key = u.tobytes()
        if key not in self._kept:
            self.evaluations += 1
            solved = self._solve(told(self.base, self.wanted, u))
            while len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = solved
            self._near = solved.states
        return self._kept[key]

    def lend(self, solved: Solved) -> None:
        """Begin from the states of rows that were solved before, with other values."""
        self._near = solved.states

    def _solve(self, assumed: Told) -> Solved:
        if self.measured.times is not None:
            return Solved(assumed, self._run(assumed).at(assumed, self.measured))
        rest = Rest(assumed.scene, self.measured, self.points, self._progress)
        near = self._near
        if near and near[0].positions.shape != rest.system.rest.shape:
            near = ()
        joints = assumed.joints(self.measured.joints(assumed.scene))
        states = rest_states(rest, joints, near or None, self._progress)
        values = np.array([rest.observer.see(state, assumed.sensor) for state in states])
        return Solved(assumed, values, rest, tuple(states))

    def jacobian(self, u: FloatArray) -> FloatArray:
        """Return d values / du, shape (k, m, p). Raises SceneError, StepError."""
        if self._slope is None or self._slope[0] != u.tobytes():
            here = self.at(u)
            if here.rest is None:
                found = self._motion_jacobian(u, here)
            else:
                found = rest_jacobian(here, self.wanted, u, self.base, self.measured, self.points)
            self._slope = (u.tobytes(), found)
        return self._slope[1]

    def _motion_jacobian(self, u: FloatArray, here: Solved) -> FloatArray:
        columns = []
        for j in range(len(u)):
            step = RUN_STEP if u[j] + RUN_STEP < self.wanted[j].bounds[1] else -RUN_STEP
            other = u.copy()
            other[j] += step
            assumed = told(self.base, self.wanted, other)
            columns.append((self._run(assumed).at(assumed, self.measured) - here.values) / step)
        return np.stack(columns, axis=-1)

    def _run(self, assumed: Told) -> Run:
        """Return the motion with some values; one of the last serves if only the sensor or the start differ."""
        assumed = replace(assumed, scene=closely(assumed.scene))
        for run in self._runs:
            if run.serves(assumed, self.measured):
                return run
        further = BEFORE if any(p.name == START for p in self.wanted) else 0.0
        run = run_motion(assumed, self.measured, self.points, self._progress, further)
        self._runs = [run, *self._runs][: len(self.wanted) + KEPT]
        return run


def rest_jacobian(
    here: Solved, wanted: Sequence[Parameter], u: FloatArray, base: Told, measured: Measured, points: Sequence[Point]
) -> FloatArray:  # fmt: skip
    """Return d values / du of poses at rest, shape (k, m, p), by the equation of this module.

    Raises:
        SceneError: a changed scene cannot be built.
        StepError: a tangent is singular.
    """
    rest = here.rest
    assert rest
    system = rest.system
    others: list[tuple[Told, Rest, FloatArray, float]] = []
    still: Rest | None = None  # a second system for what changes no scene: the first keeps its factors
    commands = measured.joints(here.told.scene)
    stand = here.told.joints(commands)
    for j, p in enumerate(wanted):
        step = STEP if u[j] + STEP < p.bounds[1] else -STEP
        changed = u.copy()
        changed[j] += step
        assumed = told(base, wanted, changed)
        joints = assumed.joints(measured.joints(assumed.scene) if p.is_field else commands)
        if p.is_field:
            other = Rest(assumed.scene, measured, points)
        elif np.array_equal(joints, stand):
            other = rest  # only what sees it is another
        else:
            other = still = still or Rest(assumed.scene, measured, points)
        others.append((assumed, other, joints, step))
    found = np.empty((*here.values.shape, len(wanted)))
    for k, state in enumerate(here.states):
        system.command(state.joints)
        if system.assemble(state, project=False) >= 0:
            raise StepError(
                f"row {k + 1} of the data: an element is unstable at rest; is the pose beyond what the robot "
                "can take?"
            )
        system.evaluate(state)
        if not system.factor():
            raise StepError(
                f"row {k + 1} of the data: the pose at rest is not stable (close to a snap); leave the row out"
            )
        residual = system.residual.copy()
        for j, (assumed, other, joints, step) in enumerate(others):
            moved = state if other is rest else _moved(system, residual, state, other, joints[k])
            seen = other.observer.see(moved, assumed.sensor)
            found[k, :, j] = (seen - here.values[k]) / step
    return found


def _moved(system: System, residual: FloatArray, state: State, other: Rest, joints: FloatArray) -> State:
    """Return where a state of rest goes to first order with what `other` and `joints` change."""
    trial = state.copy()
    if not np.array_equal(other.system.rest, system.rest):  # another mesh: another solution
        other.settle(trial, joints)
        return trial
    other.system.drive(trial, joints)
    other.system.assemble(trial, project=False)
    other.system.evaluate(trial)
    change = other.system.residual - residual
    if not change.any():
        return trial
    solution = -system.linear.solve(change)
    dx = np.zeros_like(state.positions)
    system.reduction.moves(solution, system.lever, dx)
    out = trial.copy()
    system.move(state, solution, dx, 1.0, out)
    return out


OTHER_ELEMENT = {"t4": "t10", "t10": "h20", "h20": "h27", "h27": "h20"}
"""Kinds of elements that are compared with a scene's; with those that are not named, of eight nodes, `h20`."""


def refined(assumed: Told) -> Told:
    """Return the same with every edge of the meshes halved. Raises SceneError where they cannot be."""
    return _meshed(assumed, lambda mesh: replace(mesh, refine=mesh.refine + 1))


def other_elements(assumed: Told) -> Told:
    """Return the same with elements of another kind on the same cells. Raises SceneError without a mesh."""
    return _meshed(assumed, lambda mesh: replace(mesh, element=OTHER_ELEMENT.get(mesh.element, "h20")))


def _meshed(assumed: Told, change: Callable[[Any], Any]) -> Told:
    scene = assumed.scene
    bodies = tuple(replace(b, mesh=change(b.mesh)) if b.mesh else b for b in scene.body)
    if not scene.mesh and bodies == scene.body:
        raise SceneError(f"scene {scene.name!r} has no mesh that could be changed")
    mesh = change(scene.mesh) if scene.mesh else None
    return replace(assumed, scene=replace(scene, mesh=mesh, body=bodies))
