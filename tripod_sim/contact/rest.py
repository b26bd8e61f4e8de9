"""What holds a solid at rest in contact: forces and the rows of its contacts, in the unknowns of the static body.

To first order a contact that presses keeps its gap, and one that sticks its place: with n . sum_k w_k x_k the gap of
contact c, its row is the gradient of that in the unknowns x and in the driven angles q. A spring of penalty of
stiffness rho yields by 1 / rho. With these rows,

    C_x dx + C_q dq + E lambda = 0,   E = diag(1 / rho), 0 with multipliers.

The pressure p turns and shifts with the surfaces: the stiffness -p d²g/dx² of the gap g. With t where on the two sides
the nearest points are, d = g n between them, e_t = dd/dt and v_kt = dw_k/dt, that g is a minimum over t gives

    d²g/dx_k dx_j = [w_k w_j (I - n nᵀ) - sum_ts m_kt (e_t . e_s)^-1 m_jsᵀ] / g,   m_kt = v_kt d + w_k e_t.
"""

from dataclasses import dataclass

import numpy as np

from tripod_sim.contact.solid_nodes import SolidNodes
from tripod_sim.contact.stepper import ContactStepper
from tripod_sim.contact.world import World
from tripod_sim.mesh.solid_mesh import FloatArray, IndexArray
from tripod_sim.system import System

PRESSES = 1e-3
"""Share of the largest pressure from which on a contact holds: those below may open at the next moment."""

STICKS = 0.999
"""Share of Coulomb's limit up to which friction holds: a contact at its limit slides, its friction a dead force."""

REPEATED = 1e-12
"""Square of how much of a row may be new, over the largest, for it to be a sum of the others."""


SLIGHT = 1e-6
"""Share of the largest stiffness of a turning pressure below which it is left out."""

PARALLEL = 1e-3
"""Square of the sine between two edges below which it is not clear where they touch, nor how that moves."""


@dataclass(frozen=True, eq=False)
class Rest:
    """Contacts of a solid at one state.

    Attributes:
        force: On the nodes [N], shape (n, 3).
        nodes: Of the solid, for each row, shape (m, 4).
        vectors: How a row counts the moves of these nodes, shape (m, 4, 3); zero for those that do not count.
        give: 1 / stiffness of each row [m/N], 0 for multipliers, shape (m,).
    """

    force: FloatArray
    nodes: IndexArray
    vectors: FloatArray
    give: FloatArray

    def rows(self, system: System) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return C_x [m, m/rad], shape (r, unknowns), C_q [m/rad], shape (r, s), and the diagonal of E, shape (r,).

        Rows of multipliers are turned into as many orthogonal ones as are independent: a disc on many points is held in
        six directions at most. The levers of `system` must be those of the state.
        """
        reduction, m = system.reduction, len(self.give)
        rows = np.zeros((m, reduction.unknowns + reduction.driven))
        nodal = np.zeros_like(self.force)
        for k in range(m):
            nodal[:] = 0.0
            np.add.at(nodal, self.nodes[k], self.vectors[k])
            x, q = rows[k, : reduction.unknowns], rows[k, reduction.unknowns :]
            reduction.gradient(nodal, system.lever, system.axes, x, q)
        firm, springs = rows[self.give == 0.0], rows[self.give != 0.0]
        shares, turned = np.linalg.eigh(firm @ firm.T)
        new = shares > REPEATED * shares.max(initial=0.0)
        rows = np.concatenate([(turned[:, new] / np.sqrt(shares[new])).T @ firm, springs])
        give = np.concatenate([np.zeros(int(new.sum())), self.give[self.give != 0.0]])
        return rows[:, : reduction.unknowns], rows[:, reduction.unknowns :], give


def rest_of(stepper: object, count: int) -> Rest | None:
    """Return what presses the solid that `stepper` advances, of `count` nodes; None if nothing does."""
    stepper = getattr(stepper, "awake", stepper)  # of one that may sleep
    if not isinstance(stepper, ContactStepper) or not isinstance(stepper.world.nodes, SolidNodes):
        return None
    return rest(stepper.world, stepper.world.nodes.nodes, count)


def rest(world: World, nodes: IndexArray, count: int) -> Rest | None:
    """Return what presses the solid at the end of the last step; None if nothing does.

    Contacts with rigid bodies, which go where they are pushed, are left out.

    Args:
        world: Of a simulation with a solid.
        nodes: Of the mesh, for the first vertices of the world, shape (k,).
        count: Of nodes of the mesh.
    """
    c, of = world.contacts.arrays, slice(0, world.contacts.count)
    vertex, weight = c.vertex[of], c.weight[of]
    solid, counts = vertex < len(nodes), weight != 0.0
    part = world.surfaces.body[vertex]
    moved = (part >= 1) & (part <= len(world.rigid.mass)) if world.rigid else np.zeros_like(solid)
    touching = (solid & counts).any(axis=1) & ~(moved & counts).any(axis=1)
    pressing = np.flatnonzero(touching & (c.pressure[of] > 0.0))
    if not len(pressing):
        return None
    pressure, friction, normal = c.pressure[pressing], c.friction[pressing], c.normal[pressing]
    own = nodes[np.where(solid[pressing], vertex[pressing], 0)]
    weights = np.where(solid[pressing], weight[pressing], 0.0)
    force = np.zeros((count, 3))
    np.add.at(force, own, weights[:, :, None] * (pressure[:, None] * normal + friction)[:, None])
    holds = pressure > PRESSES * pressure.max()
    sticks = holds & (np.linalg.norm(friction, axis=1) < STICKS * world.law.friction * pressure)
    one, two = _across(normal[sticks])
    which = np.concatenate([np.flatnonzero(holds), np.flatnonzero(sticks), np.flatnonzero(sticks)])
    directions = np.concatenate([normal[holds], one, two])
    give = np.zeros(len(which))
    if world.law.response == "penalty":
        stiffness = c.stiffness[pressing]
        give = 1.0 / np.concatenate([stiffness[holds, 0], stiffness[sticks, 1], stiffness[sticks, 1]])
    vectors = [weights[which][:, :, None] * directions[:, None]]
    at, gives = [own[which]], [give]
    for k in np.flatnonzero(holds):
        second = _curvature(world.positions[vertex[pressing[k]]], weight[pressing[k]], normal[k])
        second *= np.repeat(weights[k] != 0.0, 3) & np.repeat(weights[k] != 0.0, 3)[:, None]
        values, shapes = np.linalg.eigh(-pressure[k] * second)
        some = np.abs(values) > SLIGHT * np.abs(values).max()
        vectors.append(shapes[:, some].T.reshape(-1, 4, 3))
        at.append(np.tile(own[k], (int(some.sum()), 1)))
        gives.append(1.0 / values[some])
    return Rest(force, np.concatenate(at), np.concatenate(vectors), np.concatenate(gives))


def _curvature(corners: FloatArray, weights: FloatArray, n: FloatArray) -> FloatArray:
    """Return d²g/dx² of a contact, shape (12, 12); zero where it is not clear.

    Args:
        corners: x [m], shape (4, 3).
        weights: w, positive on the one side, negative on the other, zero where a vertex does not count, shape (4,).
        n: From the other side to the one.
    """
    out, used = np.zeros((12, 12)), np.flatnonzero(weights)
    x, w = corners[used], weights[used]
    one, other = np.flatnonzero(w > 0), np.flatnonzero(w < 0)
    shift = np.zeros((len(w), len(w) - 2))  # v
    for t, k in enumerate(one[1:]):
        shift[[one[0], k], t] = -1.0, 1.0
    for t, k in enumerate(other[1:], len(one) - 1):
        shift[[other[0], k], t] = 1.0, -1.0
    gap, along = float(n @ (w @ x)), x.T @ shift  # e
    square = along.T @ along
    scale = np.sqrt(np.diag(square))
    if gap > 0.0 and np.linalg.det(square / np.outer(scale, scale)) > PARALLEL:
        m = (gap * shift[:, None, :] * n[:, None] + w[:, None, None] * along.reshape(1, 3, -1)).reshape(
            3 * len(w), -1
        )
        across = np.eye(3) - np.outer(n, n)
        second = (np.kron(np.outer(w, w), across) - m @ np.linalg.solve(square, m.T)) / gap
        rows = (3 * used[:, None] + np.arange(3)).ravel()
        out[np.ix_(rows, rows)] = second
    return out


def _across(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors at right angles to each of `normals` and to each other, each of shape (m, 3)."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, axis)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.cross(normals, one)
