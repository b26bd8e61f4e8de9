"""The estimated errors of a run in words: of the mesh and of the time steps, at the effector."""

import math

from tripod_sim.integrators.report import StepReport


def error_words(mesh: float, step: float = math.nan) -> str:
    """Return lengths of the errors of mesh and time steps [m], NaN if not known, and their sum, which bounds both."""
    if math.isnan(mesh):
        return "of the mesh not known: the richer mesh has no equilibrium here"
    if math.isnan(step):
        return f"mesh {1e3 * mesh:.2g} mm"
    return f"{1e3 * (mesh + step):.2g} mm: mesh {1e3 * mesh:.2g}, step {1e3 * step:.2g}"


def mesh_error(report: StepReport) -> float:
    """Return how far the mesh puts the effector from where it should be [m]; NaN where nobody asks, or not known."""
    return report.mesh_error.distance if report.mesh_error else math.nan


def effector_error(report: StepReport) -> float:
    """Return what bounds the errors of mesh and time steps at the effector [m], as `error_words` has it; or NaN."""
    step = _step_error(report)
    return mesh_error(report) + (0.0 if math.isnan(step) else step)


def errors_line(report: StepReport) -> str:
    """Return what a step reports of its errors; empty where the scene does not ask for that of the mesh."""
    if not report.mesh_error:
        return ""
    return error_words(report.mesh_error.distance, _step_error(report))


def _step_error(report: StepReport) -> float:
    return report.time_error.effector if report.time_error else math.nan
