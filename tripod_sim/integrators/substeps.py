"""Advancing in parts: a part that fails is rolled back and halved."""

from collections.abc import Callable
from dataclasses import dataclass

from tripod_sim.errors import StepError
from tripod_sim.integrators.newton import NewtonError, NewtonReport
from tripod_sim.state import State


@dataclass
class StepReport:
    """What one step took.

    Attributes:
        iterations: Linear solves, over all parts.
        factorisations: Hessians assembled and factored, over all parts.
        parts: Parts that the step was divided into; 1 is the whole.
        halvings: Times a part failed and was halved.
        residual: Unbalanced force at the end [N].
    """

    iterations: int = 0
    factorisations: int = 0
    parts: int = 0
    halvings: int = 0
    residual: float = 0.0


def advance_in_parts(
    state: State,
    backup: State,
    part: Callable[[float, float], NewtonReport],
    max_halvings: int,
    first: float = 1.0,
) -> StepReport:
    """Advance `state` over a whole step by calls of `part(start, end)`, fractions of the step, in place.

    Args:
        state: Advanced in place; unchanged if the step cannot be saved.
        backup: Scratch of the same size.
        part: Advances the state over one part or raises NewtonError.
        max_halvings: Smallest part is `first` / 2^max_halvings.
        first: Largest part tried.

    Raises:
        StepError: the smallest part failed.
    """
    report, done, size = StepReport(), 0.0, first
    origin: State | None = None
    while done < 1.0:
        end = min(1.0, done + size)
        if 1.0 - end < 1e-9:
            end = 1.0
        state.copy_to(backup)
        try:
            result = part(done, end)
        except NewtonError as error:
            backup.copy_to(state)
            report.halvings += 1
            size *= 0.5
            if size < first * 0.5**max_halvings * 0.999:
                if origin is not None:
                    origin.copy_to(state)
                raise StepError(
                    f"step {state.step + 1} at {state.time:.4g} s cannot be saved, even in parts of "
                    f"{size * 2:.2g} of it: {error}"
                ) from error
            continue
        if end < 1.0 and origin is None:
            origin = backup.copy()
        report.iterations += result.iterations
        report.factorisations += result.factorisations
        report.residual = result.residual
        report.parts += 1
        done, size = end, min(first, size * 2 if report.halvings else size)
    return report
