"""Steps of a reduced model: any implicit scheme or the static solver moves the rows, then all nodes follow."""

from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.integrators.substeps import StepReport, Substeps
from tripod_sim.reduced.system import FloatArray, ReducedSystem
from tripod_sim.reduced.training import outside
from tripod_sim.state import State
from tripod_sim.tables.method import Reduced


class ReducedStepper(Substeps):
    """Advances states of the whole body by advancing their `reduced`."""

    def __init__(self, system: ReducedSystem, scheme: Substeps, reduced: Reduced, max_halvings: int) -> None:
        """`scheme`: advances the rows of `system`."""
        super().__init__(scheme._newton, max_halvings)
        self._reduced = reduced
        self._system, self._scheme = system, scheme

    def step(self, state: State, joints: FloatArray, dt: float) -> StepReport:
        """As `Substeps.step`; the report tells where the joints are beyond the training."""
        report = super().step(state, joints, dt)
        report.beyond = outside(self._reduced, state.joints)
        return report

    def _part(self, state: State, joints: FloatArray, h: float) -> NewtonReport:
        assert state.reduced
        report = self._scheme._part(state.reduced, joints, h)
        self._system.expand(state)
        return report

    def _largest_part(self, move: FloatArray) -> float:
        return self._scheme._largest_part(move)

    def _drop_history(self) -> None:
        self._scheme._drop_history()
