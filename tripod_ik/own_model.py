"""The model built in a thread of its own, for a node that must not stop answering meanwhile."""

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from tripod_host.arrays import FloatArray
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState
from tripod_sim.errors import SceneError, StepError

if TYPE_CHECKING:
    from tripod_ik.mesh_error import LiveMeshError
    from tripod_ik.model import StaticModel

FAR = 0.2
"""Angles that are farther than this from those of the model [rad] mean another robot pose, not a motion: the model then
goes there in its thread, too."""


class OwnModel:
    """Gives the state of the robot at its angles, once the model stands there.

    Attributes:
        failure: Why there is no model; empty while there may be one.
        mesh_error: What tells the error of its mesh; None where its scene does not ask for that.
    """

    def __init__(self, build: Callable[[FloatArray], "StaticModel"], spans: FloatArray) -> None:
        """Build nothing yet.

        Args:
            build: Makes the model at given angles [rad, spans], shape (s,); called in another thread.
            spans: Of its joints, see `StaticModel`.
        """
        self._build, self._spans = build, spans
        self._model: StaticModel | None = None
        self._thread: threading.Thread | None = None
        self.failure = ""
        self.mesh_error: LiveMeshError | None = None

    @property
    def busy(self) -> bool:
        """Whether the model is on its way to where the robot is."""
        return self._thread is not None and self._thread.is_alive()

    def state_at(self, commands: FloatArray) -> LinearState | None:
        """Return the state at `commands` [rad, m, m³, N, Pa], shape (s,); None while the model is on its way or fails.

        Raises:
            IkError: there is no equilibrium at these commands; the model stays where it was.
        """
        if commands.shape != self._spans.shape:
            self.failure = (
                f"the robot reports {len(commands)} joints, and the scene of this node has {len(self._spans)}; start "
                "it with the scene of the robot"
            )
        if self.busy or self.failure:
            return None
        angles = commands / self._spans
        if self._model is None or abs(angles - self._model.angles).max() > FAR:
            self._thread = threading.Thread(target=self._go, args=(angles.copy(),), daemon=True)
            self._thread.start()
            return None
        try:
            state = self._model.move(angles)
        except (SceneError, StepError) as error:
            raise IkError(f"model of this node: {error}") from None
        if self.mesh_error:
            self.mesh_error.look(self._model.simulation.state)
        return state

    def _go(self, angles: FloatArray) -> None:
        try:
            if self._model is None:
                model = self._build(angles)
                self.mesh_error = _error_of(model)
                self._model = model
            else:
                self._model.move(angles)
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            expected = isinstance(error, SceneError | StepError | IkError)
            self.failure = str(error) if expected else f"{type(error).__name__}: {error}"

    def close(self) -> None:
        """Wait for the threads, for a short while."""
        if self._thread is not None:
            self._thread.join(2.0)
        if self.mesh_error:
            self.mesh_error.close()


def _error_of(model: "StaticModel") -> "LiveMeshError | None":
    """Return what tells the error of a model's mesh; None where its scene does not ask for that."""
    if not (table := model.scene.mesh_error):
        return None
    from tripod_ik.mesh_error import LiveMeshError, mesh_of  # noqa: PLC0415 - an effect that is absent

    mesh = mesh_of(model)
    return LiveMeshError(mesh, table.share) if mesh else None
