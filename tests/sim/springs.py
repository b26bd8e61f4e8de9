"""Gradient and Hessian of a spring body, for tests."""

import numpy as np

from tripod_sim.springs.spring_kernels import add_gradient, add_products, tangents
from tripod_sim.springs.spring_system import SpringSystem


def add_whole_gradient(system: SpringSystem, x: np.ndarray, g: np.ndarray) -> float:
    """Add dE/dx - F to `g` [N], shape (n, 3), fixed nodes included, and return E - F . (x - X) [J]."""
    g -= system.force
    elastic = add_gradient(x, system.links, 0.0, np.zeros(len(system.links.ends)), g)
    return elastic - float(np.vdot(system.force, x - system.body.nodes))


def blocks(system: SpringSystem, x: np.ndarray, *, project: bool) -> np.ndarray:
    """Return the Hessian's block of each spring, shape (m, 6) [N/m]; see `tangents`."""
    m = len(system.links.ends)
    out = np.empty((m, 6))
    tangents(x, system.links, 0.0, np.zeros(m), project, out)
    return out


def hessian(system: SpringSystem, x: np.ndarray, *, project: bool) -> np.ndarray:
    """Return d²E/dx² of the free nodes [N/m], shape (unknowns, unknowns)."""
    free, own = system.body.free, blocks(system, x, project=project)
    columns = []
    for k in range(system.unknowns):
        unit, column = np.zeros_like(x), np.zeros_like(x)
        unit[free[k // 3], k % 3] = 1.0
        add_products(system.links.ends, own, unit, 1.0, column)
        columns.append(column[free].ravel())
    return np.array(columns).T
