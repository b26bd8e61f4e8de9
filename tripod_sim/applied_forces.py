"""Forces on points of the bodies that somebody applies while a simulation runs, such as by a mouse; constant in a step.

    V(x) = -sum_i f_i . x_i

over nodes of soft bodies and material points of free rigid bodies. Nothing of it is there before the first force.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.errors import SceneError
from tripod_sim.forces.term import ForceTerm, at_nodes
from tripod_sim.integrators.stepper import integrator_of
from tripod_sim.steps.parts import Parts

if TYPE_CHECKING:  # effects that may be absent are not imported
    from tripod_sim.contact.rigid_set import RigidSet
    from tripod_sim.springs.loop import SpringLoop

LARGEST = 1e6
"""Of a component of an applied force [N]."""


class AppliedForces(ForceTerm):
    """The term, which joins the system of a simulation and the compiled loops of its stepper."""

    name, acts_on_rigid = "applied", True

    def __init__(self, parts: Parts, count: int) -> None:
        """`count`: of the nodes by which forces are given: those of soft bodies, then the vertices of rigid ones."""
        rigid: RigidSet | None = parts.rigid
        self._soft, self._stepper = count - (rigid.count if rigid else 0), parts.stepper
        self._force = np.zeros_like(parts.system.rest)
        self._on_rigid: list[tuple[int, FloatArray, FloatArray]] = []
        shapes = rigid.shapes if rigid else []
        owners = [np.full(len(s.vertices), body) for body, s in enumerate(shapes)]
        self._owner = np.concatenate([np.zeros(0, dtype=np.int64), *owners])
        self._vertices = np.concatenate([np.zeros((0, 3)), *(s.vertices for s in shapes)])
        parts.system.take(self)
        integrator = self._integrator = integrator_of(parts.stepper)
        self._loop: SpringLoop | None = getattr(integrator, "loop", None)
        self._still = self._loop.load.force.copy() if self._loop else np.zeros(0)
        if take := getattr(integrator, "take_forces", None):
            take(self)

    @property
    def force(self) -> FloatArray:
        """f of nodes [N], shape (n, 3)."""
        return self._force

    @property
    def acts(self) -> bool:
        """Whether there is any force."""
        return bool(self._on_rigid) or bool(self._force.any())

    def set(self, forces: Mapping[int, FloatArray]) -> None:
        """Replace all forces; see `Simulation.apply_forces`. Raises SceneError."""
        end = self._soft + len(self._owner)
        for node, force in forces.items():
            if not 0 <= node < end:
                raise SceneError(f"a force is applied to node {node}; there are nodes 0 to {end - 1}")
            if np.shape(force) != (3,) or not (np.abs(force) <= LARGEST).all():  # NaN, too
                raise SceneError(
                    f"the force on node {node} is {force!r}; it must be three numbers up to {LARGEST:g} N"
                )
        self._force[:] = 0.0
        self._on_rigid = []
        for node, force in forces.items():
            if node < self._soft:
                self._force[node] += force
            else:
                own = node - self._soft
                self._on_rigid.append(
                    (int(self._owner[own]), self._vertices[own], np.array(force, dtype=float))
                )
        if self._loop:
            self._loop.load.force[:] = self._still + self._force if forces else self._still
            self._integrator.forget()  # the energy with other forces is another one
        if wake := getattr(self._stepper, "wake", None):
            wake()

    def add_gradient(self, x: FloatArray, g: FloatArray) -> float:
        """Add -f to `g` [N], shape (n, 3); return V of the nodes [J]."""
        g -= self._force
        return -float(np.vdot(self._force, x))

    def add_rigid_gradient(self, motion: RigidMotion, s: float, g: FloatArray) -> float:
        """Add -f and -(R r) x f, with r the point in the frame of its body, to `g`; return V of these points [J]."""
        energy = 0.0
        for body, point, force in self._on_rigid:
            arm = motion.rotations[body] @ point
            g[body, :3] -= force
            g[body, 3:] -= np.cross(arm, force)
            energy -= float(force @ (motion.centres[body] + arm))
        return energy

    def exerted(self, x: FloatArray, command: float, effort: float) -> tuple[FloatArray, FloatArray]:
        """Return the nodes on which forces act, and these."""
        return at_nodes(x, self._force)
