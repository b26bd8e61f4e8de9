"""The largest frequency of a spring body.

In every configuration a spring's tangent is below k times the identity (stretched, its transverse part is
k (1 - L / l)), so the body's is below that of the network of the k alone. The largest eigenvalue of M^-1 times that
network, one unknown a node, bounds the square of every frequency that the motion can ever meet: it is found once.
"""

import math

import numpy as np
from scipy import sparse

from tripod_host.arrays import FloatArray
from tripod_sim.forces.spring_kernels import rates_of
from tripod_sim.integrators.stability import largest_eigenvalue
from tripod_sim.springs.loop import SpringLoop

ITERATIONS = 2000


def network_bound(loop: SpringLoop, weights: FloatArray) -> float:
    """Return the largest eigenvalue of M^-1 L, L the network of springs with `weights` [N/m] or [N s/m], (m,).

    Gershgorin's circles bound it from above, the power iteration estimates it from below, to about one percent.
    """
    root = np.sqrt(loop.load.inverse_mass)
    n = len(root)
    i, j = loop.links.ends.T
    off = sparse.coo_matrix((-weights * root[i] * root[j], (i, j)), shape=(n, n))
    degree = (
        np.bincount(i, weights=weights, minlength=n) + np.bincount(j, weights=weights, minlength=n)
    ) * root**2
    matrix = (off + off.T + sparse.diags(degree)).tocsr()
    circles = float(np.asarray(abs(matrix).sum(axis=1)).max(initial=0.0))
    start = np.random.default_rng(0).standard_normal(n)
    return min(circles, 1.01 * largest_eigenvalue(lambda p: matrix @ p, start, ITERATIONS)[0])


def fastest(loop: SpringLoop) -> tuple[float, float]:
    """Return bounds of the largest frequency [rad/s] and rate of damping [1/s], by the force -a M v, too."""
    links = loop.links
    return math.sqrt(network_bound(loop, links.stiffness)), loop.load.drag + network_bound(
        loop, rates_of(links)
    )
