"""What advances a state, as the parts of a simulation know it."""

from typing import Any, Protocol

from tripod_host.arrays import FloatArray
from tripod_sim.integrators.report import StepReport
from tripod_sim.state import State


class Stepper(Protocol):
    """Advances a state by one step."""

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """Advance in place, or raise StepError and leave `state` as it was."""

    def forget(self) -> None:
        """Drop what was kept from earlier steps, so that the next depends on its state alone."""


def integrator_of(stepper: Any) -> Any:
    """Return what a stepper integrates with in the end: what wraps it, such as `Substeps`, has it as `integrator`."""
    while inner := getattr(stepper, "integrator", None):
        stepper = inner
    return stepper
