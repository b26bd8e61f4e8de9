"""Newton's method for springs alone in one compiled call, and their static equilibrium."""

from typing import Any

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.errors import StepError
from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.report import StepReport
from tripod_sim.linear import ldl_kernels
from tripod_sim.linear.ldl_symbolic import analyse
from tripod_sim.linear.solver import Pattern
from tripod_sim.springs import implicit_kernels as kernels
from tripod_sim.springs.cg_kernels import sweep
from tripod_sim.springs.linear_kernels import Factor, Slots
from tripod_sim.springs.spring_kernels import has_dampers
from tripod_sim.springs.spring_system import SpringSystem
from tripod_sim.state import State

WHY = {
    kernels.UNSOLVED: "the unbalanced force is still {residual:.3g} N after {most} iterations",
    kernels.NO_DESCENT: "the energy falls along no direction, at an unbalanced force of {residual:.3g} N",
    kernels.SINGULAR: "the stiffness matrix is singular",
    kernels.BROKEN: "a number is not finite",
    kernels.UNITERATED: "conjugate gradients did not converge; solver.linear = 'ldl' solves directly",
}


class SpringSolver:
    """Scratch and arguments of the implicit kernels for one body."""

    def __init__(self, system: SpringSystem, options: kernels.Options, *, drag: float, moving: bool) -> None:
        self.system, self.options = system, options
        self.problem = problem_of(system, drag=drag, moving=moving)
        self.factor = _factor(system, direct=options.direct)
        self.work = work_of(system, iterates=not options.direct)
        self.counts = np.zeros(4)

    def solve(self, state: State, s: float, *, predict: bool) -> int:
        """Solve the stage of `s` [s] that `work` describes, in place; return how that ended."""
        outcome: int = kernels.solve_stage(
            state.positions, state.velocities, s, predict, self.problem, self.factor, self.options, self.work,
            self.counts,
        )  # fmt: skip
        return outcome

    def why(self, outcome: int) -> str:
        """Return in words why `solve` failed."""
        return WHY[outcome].format(residual=float(self.counts[3]), most=self.options.max_iterations)

    def forget(self) -> None:
        """Drop the factorisation, and what is expected of the next stage."""
        self.work.kept[0] = 0.0
        self.work.rate[:] = 0.0

    def report(self) -> NewtonReport:
        """Return what was counted since the last call."""
        solves, factorisations, iterations, residual = self.counts.tolist()
        self.counts[:3] = 0.0
        return NewtonReport(int(solves), int(factorisations), residual, linear_iterations=int(iterations))


def problem_of(system: SpringSystem, *, drag: float, moving: bool) -> kernels.Problem:
    """Return a body as the kernels take it; `moving`: whether its dampers count."""
    body = system.body
    size = float(np.abs(body.nodes).max())
    rounding = 1e-15 * float(body.stiffness.max(initial=0.0)) * size * np.sqrt(len(body.ends))
    damped = moving and has_dampers(system.links)
    return kernels.Problem(
        system.links, system.mass, system.force, body.free, system.number, drag, rounding, damped
    )


def work_of(system: SpringSystem, *, iterates: bool) -> kernels.Work:
    """Return scratch for a body; `iterates`: whether conjugate gradients solve."""
    body = system.body
    n, m = len(body.nodes), len(body.ends)
    scratch: list[Any] = [*np.zeros((6, n, 3)), np.zeros((m, 6)), np.zeros(n), np.zeros(1)]
    ends, count = (body.ends, len(body.free)) if iterates else (body.ends[:0], 0)
    stage = [*np.zeros((2, n, 3)), np.zeros(m)]
    return kernels.Work._make([*scratch, sweep(ends, system.number, count), *stage])


def _factor(system: SpringSystem, *, direct: bool) -> Factor:
    """Return room for factorisations; where none is made, for those of the smallest matrix there is.

    That one is factored: so factorisation and solution are loaded before `solve_stage`, whose machine code has copies
    of them that round otherwise. The process takes those that come first, and another scene may have loaded them.
    """
    none = np.zeros((0, 3), dtype=np.int64)
    least = _room(sparse.identity(1, format="csc"), none, none)
    ldl_kernels.factor(least.plan, least.numbers)
    ldl_kernels.solve(least.b, least.plan, least.numbers, least.out)
    return _room(*system.pattern()) if direct else least


def _room(pattern: Pattern, diagonal: IndexArray, off: IndexArray) -> Factor:
    plan, n = analyse(pattern), pattern.shape[0]
    slots = Slots(pattern.data, diagonal, off)
    return Factor(slots, plan, ldl_kernels.numbers(plan, pattern.data), *np.zeros((2, n)))


class StaticSprings:
    """Moves a spring body to static equilibrium.

    By steps of implicit Euler from rest, each four times as long as the one before: a descent of the potential that
    springs without transverse stiffness cannot throw off, and that ends as Newton's method [NocedalWright2006].
    """

    MOST_STEPS = 200

    def __init__(self, system: SpringSystem, options: kernels.Options) -> None:
        options = options._replace(one_solve=False)
        self.solver = SpringSolver(system, options, drag=0.0, moving=False)
        body = system.body
        stiffest = float(body.stiffness.max(initial=0.0))
        heaviest = float(system.mass.max())
        self._first = np.sqrt(heaviest / stiffest) if stiffest > 0 else 1.0

    def forget(self) -> None:
        """Drop the factorisation."""
        self.solver.forget()

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Move `state` to equilibrium, in place. Raises StepError and leaves it."""
        solver, keep, h, steps = self.solver, state.positions.copy(), self._first, 0
        work, tolerance = solver.work, solver.options.tolerance
        self.forget()
        failures = 0
        for _ in range(self.MOST_STEPS):
            before = state.positions.copy()
            work.z[:], work.u[:] = before, 0.0
            work.rate[:] = 0.0
            outcome = solver.solve(state, h, predict=False)
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
                done = solver.report()
                return StepReport(
                    done.iterations, done.factorisations, parts=1, residual=inertia,
                    linear_iterations=done.linear_iterations,
                )  # fmt: skip
        state.positions[:], state.velocities[:] = keep, 0.0
        raise StepError(
            (
                f"step {state.step + 1}: no static equilibrium was found in {steps} load steps; the "
                f"unbalanced force is {inertia:.3g} N. Apply the load in smaller steps, or add [inertia]"
            )
            if steps
            else f"step {state.step + 1}: no static equilibrium: {solver.why(outcome)}"
        )
