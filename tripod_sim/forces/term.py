"""Terms of the potential of a step besides the strain energy (`elastic.ElasticTerm`): what a system asks of each.

A system adds up whatever terms it is given and knows none by name. What a scheme cannot handle it refuses when it is
built: explicit ones take forces that positions do not change and linear ones.
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.forces.term_kernels import add_couplings


class Term:
    """A part V(x) of the potential.

    Attributes:
        name: Of the effect that brings it, for messages.
        weight: w of a Hessian w_i I at each node [N/m], shape (n,); None: it has none of this form.
        has_inertia: Whether it has what the masses of nodes lack; see `add_inertia`.
        acts_on_rigid: Whether it acts on free rigid bodies, which hold no nodes, too; see `add_rigid_gradient`.
        exerts: Group of `acting_forces` in which its forces are shown; empty: in none.
    """

    name, has_inertia, acts_on_rigid, exerts = "", False, False, ""
    weight: FloatArray | None = None

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] at positions `x` [m] to `g`, both of shape (n, 3), and return V [J]."""
        raise NotImplementedError

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return what of V is strain energy of the bodies and what their potential in gravity [J]: none of it."""
        return 0.0, 0.0

    @property
    def node_weights(self) -> FloatArray | None:
        """Weight of each node [N], shape (n, 3); None: the term is no weight."""
        return None

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return points [m] and the forces [N] on bodies there, both of shape (k, 3), with nodes at `x` [m], (n, 3).

        `command`, `effort`: of an actuator q and dV/dq at the end of the step; the term's own may be of elsewhere.
        """
        return np.zeros((0, 3)), np.zeros((0, 3))

    def add_inertia(self, a: FloatArray, out: FloatArray) -> float:
        """Add what nodes lack in mass, times `a`, to `out`, both of shape (n, 3); return half of a . that: nothing."""
        return 0.0

    def add_rigid_gradient(self, motion: RigidMotion, s: float, g: FloatArray) -> float:
        """Add what the term is on free rigid bodies at the end of a stage; return that part of V [J].

        Args:
            motion: Their poses and velocities then, b of them; velocities change by 1 / s of a move.
            s: Of the stage [s].
            g: dV/dc [N] and, per small turn about the centre, dV/dtheta [N m], shape (b, 6).
        """
        raise NotImplementedError

    def add_rigid_stiffness(self, motion: RigidMotion, s: float, h: FloatArray) -> None:
        """Add to `h`, shape (b, 6, 6), the Hessian of that part of V, or a positive semi-definite one near it: none.

        Without it steps converge only where the term is weak against inertia, M / s².
        """


class BlockTerm(Term):
    """A term whose Hessian is a sum of blocks between few nodes.

    Attributes:
        elements: Nodes of each block, shape (m, k), the same while it lives.
        matrices: The blocks of the last `stiffness` [N/m], shape (m, 3 k, 3 k).
    """

    elements: IndexArray
    matrices: FloatArray

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices` at `x`, with `project` positive semi-definite."""
        raise NotImplementedError

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks times `dx` [m] to `g` [N], both of shape (n, 3)."""
        raise NotImplementedError


def at_nodes(x: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places and forces of those nodes whose `force` [N], shape (n, 3), is not zero; `x` [m], shape (n, 3)."""
    acts = force.any(axis=1)
    return x[acts], force[acts]


class LinearTerm(BlockTerm):
    """What ties nodes to others linearly and alike in all directions, the same everywhere.

    With d_a the place of node a from that of its other a',

        V = 1/2 sum_ab c_ab d_a . d_b,  over blocks of nodes.

    Attributes:
        elements: Nodes of each block and then their others, shape (m, 2 n).
        couplings: c_ab [N/m], symmetric, shape (m, n, n).
        matrices: [c, -c; -c, c] in each direction, shape (m, 6 n, 6 n).
    """

    def __init__(self, nodes: IndexArray, others: IndexArray, couplings: FloatArray) -> None:
        """`nodes`, `others`: shape (m, n); `couplings`: shape (m, n, n)."""
        self.elements, self.couplings = np.ascontiguousarray(np.hstack([nodes, others])), couplings
        block = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), couplings)
        size = 3 * block.shape[1]
        self.matrices = np.einsum("eab,ij->eaibj", block, np.eye(3)).reshape(len(block), size, size)

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Nothing changes with `x`."""

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add dV/dx [N] at positions `x` [m] to `g`, both of shape (n, 3), and return V [J]."""
        return float(add_couplings(self.couplings, self.elements, x, g))

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the blocks times `dx` [m] to `g` [N]."""
        self.add_gradient(dx, g)


class ForceTerm(Term):
    """Forces f that do not change with the positions: dV/dx_i = -f_i.

    Attributes:
        works: Whether V is no energy of the bodies, so that f does work on them.
    """

    works, exerts = True, "load"

    @property
    def force(self) -> FloatArray:
        """f [N], shape (n, 3)."""
        raise NotImplementedError

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return the nodes that forces act on, and these."""
        return at_nodes(x, self.force)


class StageTerm(BlockTerm):
    """A term that an implicit stage (`integrators.stage`) prepares."""

    def aim(self, s: float) -> None:
        """Prepare a stage of `s` [s]."""
        raise NotImplementedError
