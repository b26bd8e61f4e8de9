"""Cables: an actuator that pulls a line through points of bodies shorter.

A cable runs without friction through points p_0 ... p_k, straight from each to the next, with one tension T. Its
length is

    L(x) = sum_i l_i,    l_i = (|p_i+1 - p_i|² + e²)^1/2,

where e is `ROUNDING` of the length undeformed: it rounds off the kink where a segment vanishes, whose direction is then
none, and changes other lengths by less than rounding does. L_0 is the length at which the cable is just taut.

Commanded by length, q is what is pulled in [m]. With s the stiffness of the cable [N/m]

    V = 1/2 s max(0, L - (L_0 - q))²,    dV/dq = T = s max(0, L - (L_0 - q)),

so a cable that is pushed is slack. Commanded by tension, q is T [N], and

    V = max(0, q) (L - L_0),    dV/dq = L - L_0.

The Hessian T d²L/dx² + s dL/dx dL/dx^T is positive semi-definite.
"""

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError
from tripod_sim.forces.actuator import ActuatorTerm
from tripod_sim.forces.cable_kernels import add_length_gradient, add_places, directions, write_hessian
from tripod_sim.forces.solid_kernels import add_element_products
from tripod_sim.mesh.embedding import Embedding

ROUNDING = 1e-6
"""e over the length of the cable undeformed."""

STIFFNESS = 1e6
"""s of a cable for which none is given [N/m]: ten times that of a steel wire of 0.3 mm and 0.1 m. 10 N stretch it by 10
micrometres. Larger values take more iterations."""


class Cable(ActuatorTerm):
    """The term V.

    Attributes:
        elements: The nodes that move its points, shape (1, n).
        matrices: The Hessian of the last `stiffness` [N/m], shape (1, 3 n, 3 n).
        rest_length: L_0 [m].
        length: L at the last evaluation [m].
        tension: T there [N].
    """

    name, exerts = "cable", "cable tension"

    def __init__(
        self,
        points: Embedding,
        rest: FloatArray,
        *,
        by_tension: bool = False,
        stiffness: float = STIFFNESS,
        rest_length: float | None = None,
        owner: str = "cable",
    ) -> None:
        """Run a cable through points.

        Args:
            points: p_i, in the order in which the cable passes them, k + 1 of them.
            rest: Undeformed positions of all nodes [m], shape (n, 3).
            by_tension: Whether q is the tension, else the length that is pulled in.
            stiffness: s [N/m]; without effect by tension.
            rest_length: L_0 [m]; None: the length undeformed.
            owner: What messages call the cable.

        Raises:
            SceneError: fewer than two points, all in one place, or none of a body.
        """
        count, start = len(points.fixed), points.places(rest)
        length = float(np.linalg.norm(np.diff(start, axis=0), axis=1).sum())
        if not length > 0.0:
            where = (
                f"all {count} via points are at the same place" if count > 1 else f"it has {count} via points"
            )
            raise SceneError(
                f"{owner} has no length, because {where}; give it two via points at different places"
            )
        used = points.weights != 0.0
        if not used.any():
            raise SceneError(f"{owner} moves nothing, because it has no via point on a body; give it one")
        nodes = np.where(used, points.nodes, points.nodes[used][0])
        own, local = np.unique(nodes, return_inverse=True)
        self._points = points._replace(nodes=np.ascontiguousarray(nodes))
        self._local = local.reshape(nodes.shape)
        self.elements = own[None]
        self.matrices = np.zeros((1, 3 * len(own), 3 * len(own)))
        self._rounding, self._by_tension, self._stiffness = ROUNDING * length, by_tension, stiffness
        self.only_pulls = not by_tension
        self._places, self._slope = np.zeros((count, 3)), np.zeros((len(own), 3))
        self._direction, self._inverse = np.zeros((count - 1, 3)), np.zeros(count - 1)
        self._all, self.tension, self.rest_length = np.arange(1), 0.0, 0.0
        self._measure(rest)
        self.rest_length = self.length if rest_length is None else rest_length

    @property
    def places(self) -> FloatArray:
        """Places of its points at the last evaluation [m], shape (k + 1, 3)."""
        return self._places

    @property
    def route(self) -> Embedding:
        """Its points."""
        return self._points

    def _measure(self, x: FloatArray) -> float:
        """Write length, directions, T and dV/dq at `x` [m], shape (n, 3); return V [J]."""
        nodes, weights, fixed = self._points
        self._places[:] = fixed
        add_places(nodes, weights, x, self._places)
        self.length = float(directions(self._places, self._rounding, self._direction, self._inverse))
        stretch = self.length - self.rest_length
        if self._by_tension:
            self.tension, self.effort, self.effort_slope = max(0.0, self.value), stretch, 0.0
            return self.tension * stretch
        slack = -(stretch + self.value)
        stretch = max(0.0, -slack)
        taken_up = self.holds and 0.0 <= slack <= self.high - self.value
        self.gap = slack if taken_up else 0.0
        self.tension = self.effort = self._stiffness * stretch
        self.effort_slope = self._stiffness if stretch > 0.0 or taken_up else 0.0
        return 0.5 * self.tension * stretch

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add T dL/dx to `g` [N], shape (n, 3); return V [J]."""
        energy = self._measure(x)
        nodes, weights, _ = self._points
        add_length_gradient(nodes, weights, self._direction, self.tension, g)
        return energy

    def stiffness(self, x: FloatArray, *, project: bool) -> None:
        """Write `matrices` at `x`: they are positive semi-definite as they are."""
        self._measure(x)
        self._slope[:] = 0.0
        weights = self._points.weights
        add_length_gradient(self._local, weights, self._direction, 1.0, self._slope)
        write_hessian(
            self._local, weights, self._direction, self._inverse, self._slope, self.tension, self.effort_slope,
            self.matrices[0],
        )  # fmt: skip

    def add_products(self, dx: FloatArray, g: FloatArray) -> None:
        """Add the block times `dx` [m] to `g` [N], both of shape (n, 3)."""
        add_element_products(self.matrices, self.elements, self._all, dx, 1.0, g)

    def add_coupling(self, x: FloatArray, out: FloatArray) -> None:
        """Add d²V/dx dq at `x` [m] to `out`, both of shape (n, 3): dL/dx by tension, s dL/dx by length where taut."""
        self._measure(x)
        taut = 1.0 if self._by_tension else self.effort_slope
        nodes, weights, _ = self._points
        add_length_gradient(nodes, weights, self._direction, taut, out)

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return its points on bodies, and -T dL/dp there: at an end the pull along the cable."""
        places = self._points.places(x)
        along = np.diff(places, axis=0)
        along /= np.sqrt((along**2).sum(axis=1, keepdims=True) + self._rounding**2)
        pull = np.zeros_like(places)
        pull[:-1] += along
        pull[1:] -= along
        on_body = (self._points.weights != 0.0).any(axis=1)
        tension = max(0.0, command if self._by_tension else effort)
        return (places[on_body], tension * pull[on_body]) if tension else (places[:0], places[:0])

    def energies(self, x: FloatArray) -> tuple[float, float]:
        """Return the strain energy of a cable by length, and none in gravity [J]; a given tension does work only."""
        energy = self._measure(x)
        return 0.0 if self._by_tension else energy, 0.0
