"""A force on nodes along a direction whose size is commanded, or their displacement along it."""

import numpy as np
from numba import njit

from tripod_host.arrays import Array, FloatArray
from tripod_sim.forces.actuator import ActuatorTerm


class CommandedForce(ActuatorTerm):
    """A force of q newtons on nodes along a fixed direction: V = -q sum of share_a · (x_a - X_a)."""

    name, exerts = "force", "load"

    def __init__(self, shares: FloatArray, rest: FloatArray) -> None:
        """`shares`: unit direction times the share of each node, shape (n, 3); `rest`: X [m], shape (n, 3)."""
        self._shares, self._before = shares, float(np.vdot(shares, rest))
        self.elements = np.zeros((0, 1), dtype=np.int64)
        self.matrices = np.zeros((0, 3, 3))

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write nothing: the force does not change with `x`."""

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add nothing."""

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add -q shares to `g` [N], shape (n, 3); return V [J]."""
        self.effort = self._before - float(np.vdot(self._shares, x))
        g -= self.value * self._shares
        return self.value * self.effort

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add -shares."""
        out -= self._shares

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return the point at which the sum of its forces acts, and that sum."""
        along = self._shares.sum(axis=0)
        return (self._shares @ along @ x / (along @ along))[None], command * along[None]


class CommandedDisplacement(ActuatorTerm):
    """A drive that displaces nodes by q metres along a fixed direction d and leaves them free across it.

    With u_a = d · (x_a - X_a), s the stiffness of the drive and w_a the share of a node,

        V = s/2 sum_a w_a (u_a - q)²,    dV/dq = s sum_a w_a (q - u_a),

    so what it gives in return is the force that it exerts along d.
    """

    name, exerts = "force", "load"

    def __init__(self, along: FloatArray, shares: FloatArray, rest: FloatArray, stiffness: float) -> None:
        """`along`: d; `shares`: w, of sum 1, shape (n,); `rest`: X [m], shape (n, 3); `stiffness`: s [N/m]."""
        nodes = np.flatnonzero(shares)
        self._nodes, self._along = nodes, along
        self._before = rest[nodes] @ along
        self._springs = stiffness * shares[nodes]
        self.elements = nodes[:, None]
        self.matrices = self._springs[:, None, None] * np.outer(along, along)
        self.effort_slope = float(self._springs.sum())

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write nothing: the blocks s w_a d d^T do not change with `x`."""

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks times `dx` [m] to `g` [N], both of shape (n, 3)."""
        _add_springs(self._nodes, self._along, self._springs, np.zeros(len(self._nodes)), dx, g)

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add s w_a (u_a - q) d to `g` [N], shape (n, 3); return V [J]."""
        aims = self._before + self.value
        pull, energy = _add_springs(self._nodes, self._along, self._springs, aims, x, g)
        self.effort = -float(pull)
        return float(energy)

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add -s w_a d."""
        out[self._nodes] -= self._springs[:, None] * self._along

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return the middle of the nodes, weighted by their shares, and the sum of its forces."""
        return (self._springs @ x[self._nodes] / self._springs.sum())[None], effort * self._along[None]

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return the strain energy of the drive, and none in gravity [J]."""
        return self.add_gradient(x, np.zeros_like(x)), 0.0


@njit(cache=True, error_model="numpy")
def _add_springs(
    nodes: Array, along: Array, springs: Array, aims: Array, x: Array, g: Array
) -> tuple[float, float]:
    """Add k_a (d · x_a - b_a) d of each node to `g`, shape (n, 3); return sum k (d · x - b), sum k/2 (d · x - b)²."""
    pull = energy = 0.0
    for a in range(nodes.shape[0]):
        n = nodes[a]
        off = along[0] * x[n, 0] + along[1] * x[n, 1] + along[2] * x[n, 2] - aims[a]
        force = springs[a] * off
        for i in range(3):
            g[n, i] += force * along[i]
        pull += force
        energy += 0.5 * force * off
    return pull, energy
