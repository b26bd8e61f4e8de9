"""Steps of spring bodies by implicit schemes, and their static equilibrium."""

from typing import Any

import numpy as np

from tripod_sim.errors import StepError
from tripod_sim.integrators.substeps import StepReport
from tripod_sim.linear.ldl_symbolic import analyse
from tripod_sim.springs import implicit_kernels as kernels
from tripod_sim.springs.body import FloatArray
from tripod_sim.springs.cg_kernels import sweep
from tripod_sim.springs.linear_kernels import Factor
from tripod_sim.springs.system import SpringSystem
from tripod_sim.state import State

SCHEMES = {
    "implicit_euler": kernels.IMPLICIT_EULER,
    "bdf2": kernels.BDF2,
    "tr_bdf2": kernels.TR_BDF2,
}

WHY = {
    kernels.UNSOLVED: "the unbalanced force is still {residual:.3g} N after solver.max_iterations",
    kernels.NO_DESCENT: "no descent from an unbalanced force of {residual:.3g} N",
    kernels.SINGULAR: "the tangent is singular",
    kernels.BROKEN: "a number is not finite",
    kernels.UNITERATED: "conjugate gradients did not converge; solver.linear = 'ldl' solves directly",
}


class SpringSolver:
    """Scratch and arguments of the implicit kernels for one body."""

    def __init__(
        self, system: SpringSystem, options: kernels.Options, *, drag: float, rayleigh: float, moving: bool
    ) -> None:
        body = system.body
        n, m = len(body.nodes), len(body.ends)
        size = float(np.abs(body.nodes).max())
        rounding = 1e-15 * float(body.stiffness.max(initial=0.0)) * size * np.sqrt(m)
        damped = moving and bool((body.damping > 0).any())
        self.system, self.options = system, options
        self.problem = kernels.Problem(
            system.links,
            system.mass,
            system.force,
            body.free,
            system.number,
            drag,
            rayleigh,
            rounding,
            damped,
        )
        self.factor = _factor(system) if options.direct else _no_factor()
        scratch: list[Any] = [
            *np.zeros((7, n, 3)),
            *np.zeros((2, m, 6)),
            np.zeros(n),
            np.zeros(m),
            np.zeros(1),
        ]
        ends, count = (body.ends[:0], 0) if options.direct else (body.ends, len(body.free))
        self.work = kernels.Work._make([*scratch, sweep(ends, system.number, count)])
        self.counts = np.zeros(4)

    def report(self, parts: int) -> StepReport:
        """Return what was counted since the last call."""
        report = StepReport(
            iterations=int(self.counts[0]),
            factorisations=int(self.counts[1]),
            parts=parts,
            residual=float(self.counts[3]),
            linear_iterations=int(self.counts[2]),
        )
        self.counts[:3] = 0.0
        return report


def _factor(system: SpringSystem) -> Factor:
    pattern, diagonal, off = system.pattern()
    plan = analyse(pattern)
    n = len(plan.order)
    return Factor(
        pattern.data, diagonal, off, plan.order, plan.pivots, plan.rows, plan.first_row, plan.panel, plan.parent,
        plan.place, plan.target, plan.source, plan.first_entry, np.zeros(plan.largest**2), np.zeros(plan.stack),
        np.zeros(len(plan.parent), dtype=np.int64), np.zeros(int(plan.panel[-1])), np.zeros(n), np.zeros(n),
        np.zeros(plan.largest), np.zeros(n), np.zeros(n),
    )  # fmt: skip


def _no_factor() -> Factor:
    number, index, indices = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.int64)
    kinds: list[Any] = [number, indices, indices, *[index] * 10, number, number, index, *[number] * 6]
    return Factor(*kinds)


class ImplicitSprings:
    """Advances a spring body by implicit Euler, BDF2 or TR-BDF2 (see `implicit_kernels`).

    A step that fails is rolled back and made in halves.
    """

    def __init__(
        self,
        system: SpringSystem,
        scheme: str,
        options: kernels.Options,
        *,
        drag: float,
        rayleigh: float,
        max_halvings: int,
    ) -> None:
        """Prepare.

        Args:
            system: The body.
            scheme: A name of `SCHEMES`.
            options: Of the solvers.
            drag: a of the force -a M v [1/s].
            rayleigh: b of the force -b K v [s], K the springs' projected tangents at the start of the step.
            max_halvings: The smallest part of a step is 2^-max_halvings of it.
        """
        self._solver = SpringSolver(system, options, drag=drag, rayleigh=rayleigh, moving=True)
        self._scheme, self._halvings = SCHEMES[scheme], max_halvings
        n, m = len(system.body.nodes), len(system.body.ends)
        self._history, self._past, self._clock = np.zeros((5, n, 3)), np.zeros((3, m)), np.zeros(1)

    def forget(self) -> None:
        """Drop factorisation and history."""
        self._clock[0] = self._solver.work.kept[0] = 0.0

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance by one step, in place. Raises StepError and leaves `state`."""
        return self.advance(state, joints, dt, 1)

    def advance(self, state: State, joints: FloatArray, dt: float, count: int) -> StepReport:
        """Advance by `count` steps of `dt` [s] in one compiled loop, in place; the same bits as one by one.

        Raises:
            StepError: a step could not be saved even in parts; `state` is the one before it.
        """
        left, parts, halvings = count, 0, 0
        while left:
            outcome, done = self._steps(state, left, dt)
            if outcome != kernels.SOLVED:
                pieces, failures = self._halved(state, dt, outcome)
                done, parts, halvings = done + 1, parts + pieces - 1, halvings + failures
            for _ in range(done):
                state.time += dt
            state.step += done
            left -= done
        report = self._solver.report(parts + count)
        report.halvings = halvings
        return report

    def _steps(self, state: State, count: int, h: float) -> tuple[int, int]:
        s = self._solver
        outcome, done = kernels.implicit_steps(
            self._scheme, count, h, state.positions, state.velocities, self._history, self._past, self._clock,
            s.problem, s.factor, s.options, s.work, s.counts, False,
        )  # fmt: skip
        return outcome, done

    def _halved(self, state: State, dt: float, outcome: int) -> tuple[int, int]:
        """Make one step in parts; return their number and the failures. Raises StepError."""
        x, v = state.positions.copy(), state.velocities.copy()
        h, left, parts, failures = dt / 2, dt, 0, 1
        while left > 1e-9 * dt:
            if h < dt * 0.5**self._halvings * 0.999:
                state.positions[:], state.velocities[:] = x, v
                self.forget()
                why = WHY[outcome].format(residual=float(self._solver.counts[3]))
                raise StepError(
                    f"step {state.step + 1} at {state.time:.4g} s cannot be saved, even in parts of {2 * h:.2g} s: "
                    f"{why}"
                )
            result, _ = self._steps(state, 1, min(h, left))
            if result != kernels.SOLVED:
                outcome, h, failures = result, h / 2, failures + 1
                continue
            left -= min(h, left)
            parts += 1
        return parts, failures


class StaticSprings:
    """Moves a spring body to static equilibrium.

    By steps of implicit Euler from rest, each four times as long as the one before: a descent of the potential that
    springs without transverse stiffness cannot throw off, and that ends as Newton's method [NocedalWright2006].
    """

    MOST_STEPS = 200

    def __init__(self, system: SpringSystem, options: kernels.Options) -> None:
        self._solver = SpringSolver(
            system, options._replace(one_solve=False), drag=0.0, rayleigh=0.0, moving=False
        )
        body = system.body
        stiffest = float(body.stiffness.max(initial=0.0))
        heaviest = float(system.mass.max())
        self._first = np.sqrt(heaviest / stiffest) if stiffest > 0 else 1.0

    def forget(self) -> None:
        """Drop the factorisation."""
        self._solver.work.kept[0] = 0.0

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Move `state` to equilibrium, in place. Raises StepError and leaves it."""
        solver, keep, h, steps = self._solver, state.positions.copy(), self._first, 0
        work, tolerance = solver.work, solver.options.tolerance
        self.forget()
        failures = 0
        for _ in range(self.MOST_STEPS):
            before = state.positions.copy()
            work.z[:], work.u[:] = before, 0.0
            outcome = kernels.solve_stage(
                state.positions,
                state.velocities,
                h,
                solver.problem,
                solver.factor,
                solver.options,
                work,
                solver.counts,
            )
            if outcome != kernels.SOLVED:
                state.positions[:] = before
                failures += 1
                h /= 16
                if failures > 20:
                    break
                continue
            steps += 1
            inertia = float(np.linalg.norm(solver.problem.mass[:, None] * state.velocities)) / h
            h *= 4
            if inertia <= tolerance:
                state.velocities[:] = 0.0
                state.time += dt
                state.step += 1
                report = solver.report(1)
                report.residual = inertia
                return report
        state.positions[:], state.velocities[:] = keep, 0.0
        raise StepError(
            f"step {state.step + 1}: no static equilibrium after {steps} load steps, unbalanced force {inertia:.3g} N"
            if steps
            else f"step {state.step + 1}: no static equilibrium: {WHY[outcome].format(residual=solver.counts[3])}"
        )
