"""The unbalanced force at which a step counts as solved, where the scene leaves it open."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.model import Model
from tripod_sim.tables.method import Solver

SHARE = 1e-3
"""Of the weight of the lightest body, and of the loads: more would be seen in how far these bend it."""

LIGHT = 1e-6
"""Loads count as at least so much of the weight: smaller ones would be solved to what is rounded off."""

LEAST = 1e-14
"""Tolerance below which nothing is lowered [N]."""

STANDARD = 9.81
"""Acceleration by which masses count where there is no gravity [m/s²]."""


def with_tolerance(model: Model, masses: Iterable[float], dead: FloatArray | None = None) -> Model:
    """Return a model whose `solver.tolerance`, where it is the default, is small against what bends bodies, too.

    Args:
        model: Of the scene.
        masses: Of each soft body [kg]; none where all bodies are rigid.
        dead: Dead loads on nodes [N], shape (n, 3); None without any.
    """
    masses = list(masses)
    if model.solver.tolerance != Solver.tolerance or not masses:
        return model
    gravity = float(np.linalg.norm(model.gravity)) if model.gravity else 0.0
    force = float(min(masses)) * (gravity or STANDARD)
    if dead is not None and dead.any():
        force = min(force, max(float(np.linalg.norm(dead, axis=1).sum()), LIGHT * force))
    tolerance = min(model.solver.tolerance, max(SHARE * force, LEAST))
    return replace(model, solver=replace(model.solver, tolerance=tolerance))
