"""What the loop of `substeps` asks of whatever advances a state."""

from typing import TYPE_CHECKING

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.report import StepReport
from tripod_sim.integrators.stepper import Stepper
from tripod_sim.state import State

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.integrators.newton import Newton, NewtonReport
    from tripod_sim.integrators.time_error import ErrorTransport


class Integrator:
    """Advances a state over one substep. By default it keeps nothing from one substep to the next.

    The loop saves the state before each substep and restores it after one that fails; `advance` may leave it anywhere.

    Attributes:
        newton: Solves the stages; None where something else does.
        errors: Carries the error of the time steps along; None where nobody asks for it.
    """

    newton: "Newton | None" = None
    errors: "ErrorTransport | None" = None

    def advance(self, state: State, joints: FloatArray, h: float) -> "StepReport | NewtonReport":
        """Advance `state` by `h` [s] while the driven frames move to `joints`, shape (s + 1,), in place.

        The loop counts steps and sets the time. Raises UnsolvedError.
        """
        raise NotImplementedError

    def advance_truncated(self, state: State, joints: FloatArray, h: float) -> "StepReport | NewtonReport":
        """Advance as `advance`, by a smaller move where nothing else is left to try; by default there is none."""
        return self.advance(state, joints, h)

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""

    def drop_history(self) -> None:
        """Use nothing of earlier substeps in the next; factorisations are kept."""

    def keep_history(self) -> None:
        """Remember the history, for `recall_history`."""

    def recall_history(self) -> None:
        """Take back what the last substep has changed in the history."""

    def restarts(self) -> bool:
        """Return whether the last substep must be made again without history, since velocities jumped in it."""
        return False

    def restarted(self) -> None:
        """Take notice that the last substep was made again."""

    def renew(self, state: State, dt: float) -> None:
        """Refactor ahead of the next step, of `dt` [s] from `state`, where that takes long. Called when idle."""


class StepperIntegrator(Integrator):
    """Lets a stepper, which saves its state itself, advance over substeps.

    Attributes:
        integrator: The stepper.
    """

    def __init__(self, stepper: "Stepper") -> None:
        self.integrator = stepper

    def advance(self, state: State, joints: FloatArray, h: float) -> StepReport:
        """Advance by a step of `h` [s]."""
        return self.integrator.step(state, joints, h)

    def forget(self) -> None:
        """Drop what was kept from earlier steps."""
        self.integrator.forget()

    def recall_history(self) -> None:
        """Drop it all: no history is known."""
        self.integrator.forget()
