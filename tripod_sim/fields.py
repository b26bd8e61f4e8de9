"""Fields on the nodes of soft bodies: displacement, stress, energy density, stretch, tension.

All but `mesh_error` (see `Simulation.mesh_error_field`) follow from positions alone, so they can also be computed of a
recording, and are computed only on request.

Elements have their values at integration points. In each element the shape functions of its corners are fitted to
these by least squares, and evaluated at its nodes: local smoothing [HintonCampbell1974]. Energy density is quadratic
where stress is linear. So psi - P:F/2 is extrapolated, and P:F/2 of the extrapolated P and F is added: that is exact
where psi is quadratic in F. A node takes the mean of its elements, weighted by their undeformed volumes, as the
recovery of error estimates does [ZienkiewiczZhu1992].

Stress invariants are those of the mean stress tensor, and the largest stretch is that of the mean deformation gradient.
A uniform field is exact. At the border between two materials the stress is the mean of both sides. At an edge where
theory has a singularity it grows with each finer mesh.

Incompatible modes are where the strain energy is least at the given positions. Dampers do not count.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_matrix

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.elements.element import Element
from tripod_sim.errors import SceneError, shown
from tripod_sim.forces.elastic import ElasticTerm
from tripod_sim.forces.mode_kernels import settle_modes
from tripod_sim.forces.solid_arrays import SolidArrays
from tripod_sim.forces.solid_kernels import ELASTIC
from tripod_sim.forces.stress_kernels import ENERGY, GRADIENT, PIOLA, STRESS, VALUES, write_points
from tripod_sim.materials.laws import SHEAR

BALANCED = 1e-10
"""Unbalanced force of an element's modes, over the shear modulus and the element's volume to the power 2/3."""


MESH_ERROR: Final = "mesh_error"
"""The field that `Simulation.mesh_error_field` returns: it belongs to the last estimate, not to positions."""


@dataclass(frozen=True)
class NodalField:
    """What a field is.

    Attributes:
        label: For people.
        unit: Of its values; empty: none.
        signed: Whether values may have both signs.
        solid, spring: Whether solids have it, and nets of springs.
    """

    label: str
    unit: str
    signed: bool = False
    solid: bool = True
    spring: bool = False


FIELDS: Final[Mapping[str, NodalField]] = {
    "displacement": NodalField("displacement", "m", spring=True),
    "von_mises": NodalField("von Mises stress", "Pa"),
    "principal_max": NodalField("largest principal stress", "Pa", signed=True),
    "principal_min": NodalField("smallest principal stress", "Pa", signed=True),
    "energy_density": NodalField("strain energy density", "J/m³"),
    "stretch": NodalField("largest stretch", "", spring=True),
    "tension": NodalField("largest spring tension", "N", signed=True, solid=False, spring=True),
    MESH_ERROR: NodalField("mesh error", "m", solid=False),
}
"""The fields by name. Stresses are Cauchy's, tension positive. The displacement is the distance from the undeformed
shape. At a node of springs, stretch (length over rest length) and tension are the largest of its springs."""


def names_of(terms: Iterable[ElasticTerm]) -> tuple[str, ...]:
    """Return the names of the fields that bodies with these terms of the strain energy have."""
    terms = list(terms)
    solid, spring = (
        any(term.solid is not None for term in terms),
        any(term.links is not None for term in terms),
    )
    return tuple(
        name for name, field in FIELDS.items()
        if name == "displacement" or (field.solid and solid) or (field.spring and spring)
    )  # fmt: skip


def extrapolation(kind: Element) -> FloatArray:
    """Return the matrix from values at the integration points of an element to those at its nodes, shape (n, q)."""
    functions = kind.plain.functions
    return functions(kind.reference) @ np.linalg.pinv(functions(kind.points))


class NodalFields:
    """Computes fields of one simulation. It shares no array that a step writes, so another thread may use it.

    Attributes:
        names: Of the fields that the bodies of the simulation have.
    """

    def __init__(self, terms: Iterable[ElasticTerm], undeformed: FloatArray, owners: IndexArray) -> None:
        """Prepare.

        Args:
            terms: The strain energy.
            undeformed: Positions of all nodes [m], shape (n, 3).
            owners: The node to which each shown vertex belongs, shape (v,).
        """
        terms = list(terms)
        self._undeformed, self._owners = np.array(undeformed), owners
        solids = [(term, term.solid) for term in terms if term.solid is not None]
        self._solids = [_SolidValues(arrays, term) for term, arrays in solids]
        self._springs = [term.links for term in terms if term.links is not None]
        self._mean = _volume_mean([arrays for _, arrays in solids], len(undeformed)) if solids else None
        self.names = names_of(terms)

    def values(self, names: Iterable[str], positions: FloatArray) -> dict[str, FloatArray]:
        """Return fields at the shown vertices, by name, each of shape (v,).

        A vertex has NaN where its node has no value: nodes of rigid bodies, nodes whose elements are all held rigid,
        and nodes of an element that is inside out.

        Args:
            names: Of `FIELDS`.
            positions: Of all nodes [m], shape (n, 3).

        Raises:
            SceneError: there is no field of a name, or the bodies do not have it.
        """
        names = self.checked(names)
        found: dict[str, FloatArray] = {}
        if "displacement" in names:
            found["displacement"] = np.linalg.norm(positions - self._undeformed, axis=1)
        others = [name for name in names if name != "displacement"]
        nodal: dict[str, FloatArray] = {}
        if self._mean and any(FIELDS[name].solid for name in others):
            x = np.ascontiguousarray(positions)
            nodal = _derived(self._mean(np.concatenate([solid.values(x) for solid in self._solids])), others)
        for name in others:
            found[name] = nodal.get(name, np.full(len(positions), np.nan))
            if FIELDS[name].spring and self._springs:
                self._take_springs(name, positions, found[name])
        return {name: found[name][self._owners] for name in names}

    def checked(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return `names` as they are. Raises SceneError: there is no such field here."""
        names = tuple(names)
        for name in names:
            if name not in self.names:
                why = "these bodies do not have it" if name in FIELDS else "there is no such field"
                if name == MESH_ERROR:
                    why = "it does not follow from positions; Simulation.mesh_error_field returns it"
                raise SceneError(f"field {shown(name)}: {why}; choose one of {', '.join(self.names)}")
        return names

    def _take_springs(self, name: str, positions: FloatArray, out: FloatArray) -> None:
        """Write the largest value of the springs at each node that has any to `out`, shape (n,)."""
        for net in self._springs:
            i, j = net.ends.T
            length = np.linalg.norm(positions[j] - positions[i], axis=1)
            if name == "stretch":
                value = np.divide(length, net.rest, out=np.full(len(length), np.nan), where=net.rest > 0)
            else:
                value = net.stiffness * (length - net.rest)
                if net.slack:
                    np.maximum(value, 0.0, out=value)
            for ends in (i, j):
                np.fmax.at(out, ends, value)


class _SolidValues:
    """State of a solid at the nodes of its elements."""

    def __init__(self, arrays: SolidArrays, term: ElasticTerm) -> None:
        self._arrays = arrays._replace(inverse=np.zeros_like(arrays.inverse), y=np.zeros_like(arrays.y))
        self._modes, self._extrapolation = term.rest_modes(), extrapolation(term.kind)
        self._points = np.zeros((*arrays.weight.shape, VALUES))
        force = BALANCED * arrays.p[SHEAR] * arrays.weight.sum(axis=1).mean() ** (2 / 3)
        self._tolerance = float(force**2)

    def values(self, x: FloatArray) -> FloatArray:
        """Return stress, F and energy density at positions `x` [m], a row for each node of each element, 16 columns."""
        if self._modes.size:
            self._settle(x)
        points = self._points
        write_points(x, self._modes, self._arrays, points)
        points[..., ENERGY] -= 0.5 * _work(points)
        nodal = self._extrapolation @ points
        nodal[..., ENERGY] += 0.5 * _work(nodal)
        return np.delete(nodal, np.s_[PIOLA:ENERGY], axis=2).reshape(-1, PIOLA + 1)

    def _settle(self, x: FloatArray) -> None:
        """Bring the modes to their least energy, from those of the last call."""
        if np.isfinite(self._settled(x, slice(None))):
            return
        self._modes[:] = 0.0
        if np.isfinite(self._settled(x, slice(None))):
            return
        for e in range(
            len(self._modes)
        ):  # an element without energy is no reason to leave out those behind it
            self._settled(x, slice(e, e + 1))

    def _settled(self, x: FloatArray, part: slice) -> float:
        a = self._arrays
        some = a._replace(
            elements=a.elements[part],
            G=a.G[part],
            weight=a.weight[part],
            inverse=a.inverse[part],
            before=a.before[part],
        )
        tolerance = self._tolerance * len(some.elements)
        return float(settle_modes(x, self._modes[part], some, ELASTIC, tolerance))


def _work(values: FloatArray) -> FloatArray:
    """Return P:F [J/m³] of the columns of `stress_kernels`."""
    return np.asarray((values[..., GRADIENT:PIOLA] * values[..., PIOLA:ENERGY]).sum(axis=-1))


def _volume_mean(solids: Sequence[SolidArrays], count: int) -> Callable[[FloatArray], FloatArray]:
    """Return what takes values at the nodes of each element, (p, c), to their means at `count` nodes, (n, c)."""
    nodes = np.concatenate([solid.elements.ravel() for solid in solids])
    volume = np.concatenate([np.repeat(s.weight.sum(axis=1), s.elements.shape[1]) for s in solids])
    total = np.bincount(nodes, volume, count)
    shares = csr_matrix((volume / total[nodes], (nodes, np.arange(len(nodes)))), (count, len(nodes)))
    nowhere = total == 0.0

    def mean(values: FloatArray) -> FloatArray:
        found = np.asarray(shares @ values)
        found[nowhere] = np.nan
        return found

    return mean


def _derived(nodal: FloatArray, names: Iterable[str]) -> dict[str, FloatArray]:
    """Return fields of solids at nodes, each of shape (n,), from recovered values, shape (n, 16)."""
    found, known = dict[str, FloatArray](), np.isfinite(nodal).all(axis=1)
    values = nodal[known]
    xx, yy, zz, xy, yz, zx = values[:, STRESS:GRADIENT].T
    for name in names:
        if name == "von_mises":
            square = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + zx**2)
            some = np.sqrt(square)
        elif name in ("principal_max", "principal_min"):
            tensor = np.stack([xx, xy, zx, xy, yy, yz, zx, yz, zz], axis=1).reshape(-1, 3, 3)
            some = np.linalg.eigvalsh(tensor)[:, 2 if name == "principal_max" else 0]
        elif name == "energy_density":
            some = np.maximum(values[:, PIOLA], 0.0)  # an extrapolation may fall below
        elif name == "stretch":
            F = values[:, GRADIENT:PIOLA].reshape(-1, 3, 3)
            some = np.linalg.svd(F, compute_uv=False)[:, 0]
        else:
            continue
        found[name] = np.full(len(nodal), np.nan)
        found[name][known] = some
    return found
