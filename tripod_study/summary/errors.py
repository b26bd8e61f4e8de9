"""The estimated errors of a run in words: of the mesh and of the time steps, at the effector."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tripod_sim.integrators.report import MeshErrorReport, StepReport


@dataclass
class LargestErrors:
    """The largest estimated errors of a run [m], NaN for what is not estimated.

    Where a motion ends at rest, the error at the end says nothing of the motion.

    Attributes:
        effector, largest, added, ball: Of the time steps, as in `TimeErrorReport`.
        node: Where `largest` is; -1 without it.
        mesh: Of the mesh at the effector.
        both: Of mesh and time steps `together` at the effector.
    """

    effector: float = math.nan
    largest: float = math.nan
    node: int = -1
    added: float = math.nan
    ball: float = math.nan
    mesh: float = math.nan
    both: float = math.nan

    def add(self, report: StepReport) -> None:
        """Take in what a step reports."""
        if found := report.time_error:
            if _larger(self.largest, found.largest) != self.largest:
                self.node = found.node
            for name in ("effector", "largest", "added", "ball"):
                setattr(self, name, _larger(getattr(self, name), getattr(found, name)))
        if report.mesh_error:
            self.add_mesh(report, report.mesh_error)

    def add_mesh(self, report: StepReport, found: MeshErrorReport) -> None:
        """Take in the error of the mesh after the step of `report`."""
        vector = report.time_error.vector if report.time_error else None
        both = together(found.effector, _step_error(report), vector)
        self.mesh, self.both = _larger(self.mesh, found.distance), _larger(self.both, both)


def _larger(a: float, b: float) -> float:
    """Return the larger of two numbers; of a number and NaN the number."""
    return b if b > a or math.isnan(a) else a


def together(mesh: Sequence[float], step: float, vector: Sequence[float] | None) -> float:
    """Return the length of the errors of mesh and time steps together [m], NaN where that of the mesh is not known.

    Both are signed, exact minus computed, and may cancel. Where only the length of the latter is known, their sum
    bounds them; where not even that, it is the former alone.

    Args:
        mesh: Its error [m].
        step: Length of that of the time steps [m], or NaN.
        vector: That error [m], if known.
    """
    if vector is None:
        return math.hypot(*mesh) + (0.0 if math.isnan(step) else step)
    return math.hypot(*(m + v for m, v in zip(mesh, vector, strict=True)))


def error_words(mesh: float, step: float = math.nan, both: float = math.nan) -> str:
    """Return lengths of the errors of mesh and time steps, and of both together [m], NaN if not known, in words."""
    if math.isnan(mesh):
        return "of the mesh not known: the richer mesh has no equilibrium here"
    if math.isnan(step):
        return f"mesh {1e3 * mesh:.2g} mm"
    return f"{1e3 * both:.2g} mm: mesh {1e3 * mesh:.2g}, step {1e3 * step:.2g}"


def mesh_error(report: StepReport) -> float:
    """Return how far the mesh puts the effector from where it should be [m]; NaN where nobody asks, or not known."""
    return report.mesh_error.distance if report.mesh_error else math.nan


def effector_error(report: StepReport) -> float:
    """Return the error of mesh and time steps `together` at the effector [m], NaN where nobody asks, or not known."""
    if not report.mesh_error:
        return math.nan
    vector = report.time_error.vector if report.time_error else None
    return together(report.mesh_error.effector, _step_error(report), vector)


def errors_line(report: StepReport) -> str:
    """Return what a step reports of its errors; empty where the scene does not ask for that of the mesh."""
    if not report.mesh_error:
        return ""
    return error_words(report.mesh_error.distance, _step_error(report), effector_error(report))


def _step_error(report: StepReport) -> float:
    return report.time_error.effector if report.time_error else math.nan
