"""The linearised state of the body: what inverse kinematics knows of the robot.

Commands of servos are angles [rad]. Those of other actuators are in *spans*, so that all are of order one: the command
in SI over `Actuator.span`, which is the range over 1.5. Wherever inverse kinematics says rad of a command, it is a span
of an actuator that is no servo; its effort is in N m, too: work per span.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix, rotation_matrix
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError

if TYPE_CHECKING:
    from tripod_sim.tables.joints import Actuator

ASYMMETRY = 1e-6
"""Largest |W - Wᵀ| accepted, relative to the largest entry of W."""

SINGULAR = 1e-9
"""Eigenvalues of W_aa below this part of the largest count as zero: no torque turns the servos that way."""


AT_REST = frozen("equilibrium_offset", np.zeros(6), (6,))
"""Offset of an effector that rests where it is."""


@dataclass(frozen=True, eq=False)
class LinearState:
    """Linearised static response of the body about one state; the fields of tripod_msgs/Compliance.

    With A the tangent stiffness and H the rows of effector and servos, W = H A⁻¹ Hᵀ maps forces to
    displacements:

        [d_effector]   [W_ee  W_ea] [force and torque on the effector]
        [d_angles  ] = [W_ae  W_aa] [d_torques                       ]

    Attributes:
        joint_names: The n servos, in the order of the rows.
        angles: Servo angles [rad], shape (n,).
        efforts: Torque of each servo on the body about its axis [N m], shape (n,).
        effector: Position of the effector [m], shape (3,), in the frame `world`.
        rotation: Orientation of the effector, unit quaternion (x, y, z, w), shape (4,).
        equilibrium_offset: From that pose to the static equilibrium at the same angles: translation [m] (3)
            and rotation vector [rad] (3), shape (6,).
        W: Compliance, symmetric, shape (6 + n, 6 + n) [m/N, m/(N m), rad/N, rad/(N m)].
        stability_margin: ρ, how far the body is from a snap, see `tripod_sim.stability_margin`; 1 where that is not
            known.
        stability_margin_slope: dρ/dα [1/rad], shape (n,); zero where it is not known; none at all is zero.
        actuators: The joints as their commands know them, where some are no servos; else none.
        held: J and K, where W_aa may be singular, so that they cannot be found from it: with such actuators.
        places: Of further places of the effector, by name: where each is [m], from there to where it rests [m], shape
            (3,) each, and its J [m/rad], shape (3, n).
    """

    joint_names: tuple[str, ...]
    angles: FloatArray
    efforts: FloatArray
    effector: FloatArray
    rotation: FloatArray
    equilibrium_offset: FloatArray
    W: FloatArray
    stability_margin: float = 1.0
    stability_margin_slope: FloatArray = field(default_factory=lambda: np.zeros(0))
    actuators: tuple["Actuator", ...] = ()
    held: tuple[FloatArray, FloatArray] | None = None
    places: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = tuple(self.joint_names)
        n = len(names)
        if n == 0 or len(set(names)) != n:
            raise IkError(f"joint names {list(names)}: at least one, each once")
        shapes = {
            "angles": (n,),
            "efforts": (n,),
            "effector": (3,),
            "rotation": (4,),
            "equilibrium_offset": (6,),
            "W": (6 + n, 6 + n),
            "stability_margin_slope": (n,),
        }
        if not np.size(self.stability_margin_slope):
            object.__setattr__(self, "stability_margin_slope", np.zeros(n))
        if not np.isfinite(self.stability_margin):
            raise IkError(f"stability_margin is {self.stability_margin}; it must be finite")
        object.__setattr__(self, "joint_names", names)
        if self.held:
            J, K = frozen("J", self.held[0], (6, n)), frozen("K", self.held[1], (n, n))
            object.__setattr__(self, "held", (J, K))
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        length = hypot(*self.rotation.tolist())
        if not abs(length - 1.0) < 1e-3:
            raise IkError(f"rotation has length {length:g}; it must be a unit quaternion")
        asymmetry, largest = float(abs(self.W - self.W.T).max()), float(abs(self.W).max())
        if not asymmetry <= ASYMMETRY * largest:
            raise IkError(f"W differs from its transpose by {asymmetry:g}, its largest entry is {largest:g}")

    @classmethod
    def of_actuators(
        cls,
        actuators: Sequence["Actuator"],
        *,
        commands: FloatArray,
        efforts: FloatArray,
        effector: FloatArray,
        rotation: FloatArray,
        equilibrium_offset: FloatArray,
        W: FloatArray,
        jacobian: FloatArray,
        stiffness: FloatArray,
        places: Mapping[str, tuple[FloatArray, FloatArray, FloatArray]] | None = None,
    ) -> "LinearState":
        """Return the state of joints some of which are no servos, from values in SI; of these no margin is known.

        Args:
            actuators: The n joints.
            commands, efforts: q and dV/dq, shape (n,).
            effector, rotation, equilibrium_offset: As the attributes.
            W: Shape (6 + n, 6 + n).
            jacobian, stiffness: J, shape (6, n), and K, shape (n, n).
            places: As the attribute.

        Raises:
            IkError: an array has another shape, or is not finite.
        """
        spans, n = np.array([a.span for a in actuators]), len(actuators)
        turn, scale = np.append(np.ones(6), 1.0 / spans), np.outer(spans, spans)
        shapes = {"angles": (n,), "efforts": (n,), "W": (6 + n, 6 + n), "J": (6, n), "K": (n, n)}
        given = zip(shapes, (commands, efforts, W, jacobian, stiffness), strict=True)
        arrays = {name: np.asarray(values, float) for name, values in given}
        for name, array in arrays.items():
            if array.shape != shapes[name]:
                raise IkError(f"{name} has shape {array.shape}; it must be {shapes[name]}")
        return cls(
            tuple(a.name for a in actuators), arrays["angles"] / spans, arrays["efforts"] * spans, effector, rotation,
            equilibrium_offset, arrays["W"] * np.outer(turn, turn), actuators=tuple(actuators),
            held=(arrays["J"] * spans, arrays["K"] * scale),
            places={name: (at, off, J * spans) for name, (at, off, J) in (places or {}).items()},
        )  # fmt: skip

    @property
    def spans(self) -> FloatArray:
        """Commands in SI over those here, shape (n,)."""
        return np.array([a.span for a in self.actuators] or [1.0] * len(self.joint_names))

    @property
    def turns(self) -> bool:
        """Whether the effector has an orientation; a point and the mean of a set have none."""
        return not self.held or bool(self.held[0][3:].any())

    @property
    def quantities(self) -> tuple[str, ...]:
        """What is commanded of each joint, in a word, such as "angle"."""
        return tuple(a.quantity for a in self.actuators) or ("angle",) * len(self.joint_names)

    @property
    def effort_quantities(self) -> tuple[str, ...]:
        """What each joint does where a position is commanded, in a word, such as "torque"; else empty."""
        if not self.actuators:
            return ("torque",) * len(self.joint_names)
        return tuple("" if a.is_effort else a.effort_quantity for a in self.actuators)

    def as_it_is(self) -> "LinearState":
        """Return the same response, at rest where the effector is at present. All else is shared, not checked again."""
        here = object.__new__(LinearState)
        places = {name: (at, np.zeros(3), J) for name, (at, _, J) in self.places.items()}
        here.__dict__.update(self.__dict__, equilibrium_offset=AT_REST, places=places)
        for name in ("equilibrium", "equilibrium_rotation"):
            here.__dict__.pop(name, None)
        return here

    def place(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Return where a place of the effector rests [m], shape (3,), and its J, shape (3, n); "": the effector itself.

        Raises IkError where the state does not tell.
        """
        if not name:
            return self.equilibrium, self.jacobian[:3]
        if name not in self.places:
            known = ", ".join(self.places) or "none"
            raise IkError(f"the state has no place {name!r} (known: {known}); with contact there are none")
        at, offset, jacobian = self.places[name]
        return at + offset, jacobian

    @cached_property
    def equilibrium(self) -> FloatArray:
        """Position of the effector at rest at these angles [m], shape (3,)."""
        return self.effector + self.equilibrium_offset[:3]

    @cached_property
    def equilibrium_rotation(self) -> FloatArray:
        """Orientation of the effector at rest at these angles, matrix, shape (3, 3)."""
        return rotation_matrix(self.equilibrium_offset[3:]) @ quaternion_matrix(self.rotation)

    @cached_property
    def stiffness(self) -> FloatArray:
        """K = W_aa⁻¹: change of the torques with the angles [N m/rad], shape (n, n).

        It is the pseudo-inverse by eigenvalues. A direction without compliance is one in which no torque
        turns the servos; there K is zero, and inverse kinematics leaves it alone. W_aa may be indefinite: at
        fixed angles the body can be stable where it would not be at fixed torques.
        """
        if self.held:
            return self.held[1]
        block = self.W[6:, 6:]
        values, vectors = np.linalg.eigh(0.5 * (block + block.T))
        known = values.tolist()
        cutoff = max(SINGULAR * max(map(abs, known)), 1e-12)
        inverse = np.array([1.0 / value if abs(value) > cutoff else 0.0 for value in known])
        return (vectors * inverse) @ vectors.T

    @cached_property
    def jacobian(self) -> FloatArray:
        """W_ea W_aa⁻¹: motion of the resting effector with the angles [m/rad, rad/rad], shape (6, n)."""
        if self.held:
            return self.held[0]
        return self.W[:6, 6:] @ self.stiffness
