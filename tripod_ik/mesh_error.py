"""The error that the mesh of the own model makes of the effector's position, where its scene asks for it.

`tripod_sim.mesh_error` has the method. In a running node it is no work for the control loop, which it would hold up by
some 10 ms, and by more where the richer mesh must go its own way: it is done in a thread of its own, and what is told
is the last estimate.
"""

import math
import sys
import threading
import time
from typing import TYPE_CHECKING

from tripod_host.arrays import FloatArray
from tripod_host.priority import stand_back
from tripod_ik.model import StaticModel
from tripod_ik.planner_thread import HANDOVER
from tripod_sim.errors import StepError
from tripod_sim.mesh.solid_mesh import SolidMesh
from tripod_sim.scene import Scene
from tripod_sim.simulation import Simulation
from tripod_sim.state import State

if TYPE_CHECKING:
    from tripod_sim.integrators.report import MeshErrorReport
    from tripod_sim.mesh_error.estimate import MeshError

UNKNOWN = math.nan, math.nan, math.nan


class ModelMesh:
    """Tells the error of a model's mesh at one pose after another; NaN where it is not known."""

    def __init__(self, scene: Scene, mesh: SolidMesh) -> None:
        """`scene`, `mesh`: of the model, at rest."""
        self._scene, self._mesh = scene, mesh
        self._errors: MeshError | None = None

    def error(self, state: State) -> "MeshErrorReport":
        """Return the error at `state`; the first time builds the richer mesh.

        That begins undeformed, and then takes the shape that the body has: driven straight to a pose, it may come to
        another equilibrium than the body did by its way.

        Raises:
            SceneError: it cannot be built.
        """
        from tripod_sim.build import build_model  # noqa: PLC0415 - an effect that is absent
        from tripod_sim.integrators.report import MeshErrorReport  # noqa: PLC0415
        from tripod_sim.mesh_error.estimate import MeshError  # noqa: PLC0415
        from tripod_sim.scene.lowering import lowered  # noqa: PLC0415

        try:
            if not self._errors:
                model = lowered(self._scene)
                self._errors = MeshError(model, self._mesh, build_model(model))
                self._errors.start(Simulation(self._scene).state)
            return self._errors.estimate(state)
        except StepError:
            return MeshErrorReport(UNKNOWN, state.time)


def mesh_of(model: StaticModel) -> ModelMesh | None:
    """Return what tells the error of a model's mesh; None where its scene does not ask, or has other bodies."""
    scene, mesh = model.simulation.scene, model.simulation.mesh
    return ModelMesh(scene, mesh) if model.scene.mesh_error and isinstance(mesh, SolidMesh) else None


class LiveMeshError:
    """Tells the error of the mesh of a model that a running robot moves.

    Attributes:
        distance: Length of the last estimate [m]; NaN while there is none, or where it is not known.
        reason: Why there is none, where there never will be; else empty.
    """

    def __init__(self, mesh: ModelMesh, share: float) -> None:
        """`share`: of the time, what estimates may take of a processor's; the first, which builds, is not counted."""
        self._mesh, self._pause = mesh, max(1.0 / share - 1.0, 0.0)
        self._thread: threading.Thread | None = None
        self._asked: FloatArray | None = None
        self._next = -math.inf
        self.distance, self.reason = math.nan, ""

    def look(self, state: State) -> None:
        """Take notice of where the model stands; it is estimated where it has moved, as often as its share allows."""
        busy = self._thread is not None and self._thread.is_alive()
        moved = self._asked is None or not (state.joints == self._asked).all()
        if busy or self.reason or not moved or time.monotonic() < self._next:
            return
        self._asked = state.joints.copy()
        sys.setswitchinterval(min(sys.getswitchinterval(), HANDOVER))
        self._thread = threading.Thread(target=self._estimate, args=(state.copy(),), daemon=True)
        self._thread.start()

    def _estimate(self, state: State) -> None:
        stand_back()
        begin, first = time.thread_time(), self._next == -math.inf
        try:
            self.distance = self._mesh.error(state).distance
        except Exception as error:  # noqa: BLE001 - a thread that just died would look alive from outside
            self.distance, self.reason = math.nan, str(error) or type(error).__name__
        taken = 0.0 if first else time.thread_time() - begin
        self._next = time.monotonic() + self._pause * taken

    def close(self) -> None:
        """Wait for the thread, for a short while."""
        if self._thread is not None:
            self._thread.join(2.0)
