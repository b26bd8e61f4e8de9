"""The ball on the soft body itself and on the tops of its servos.

Each step the surface moves the ball, and the ball's impulses, shared among the corners of the triangles it touched,
load the next step. The ball must be light against the body, so that this delay is stable.
"""

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.ball.ball import ABYSS, BallState, Place
from tripod_sim.ball.obstacle_kernels import triangle_distance
from tripod_sim.ball.plate_kernels import SKIN, fall
from tripod_sim.ball.rest import carried, rolling_stiffness
from tripod_sim.ball.surface_kernels import advance_on_surface, workspace
from tripod_sim.constraints.groups import DrivenFrame
from tripod_sim.effects.ball import Ball
from tripod_sim.errors import SceneError
from tripod_sim.forces.loads import NodalLoads
from tripod_sim.state import State

HEAVIEST = 1 / 32
"""Mass of the ball over that of the body up to which the delayed load is stable."""

AVERAGE = 0.05
"""Without inertia the body cannot take an impact; it then feels the ball's force averaged over this time [s]."""

LOST = 0.1
"""Depth below the mid-plane at which the ball counts as lost [m]."""

SERVO = np.array([0.0225, 0.0118, 0.0227])
"""Length (along the axis), width and height of the body of an SG90 [m]; its axis lies in the middle of its top."""

TOUCHES = 1e-6
"""Gap up to which a ball that lies on something counts as touching it [m]."""

SAME, INSIDE = 1 - 1e-9, 1e-9
"""Cosine from which on two normals are one contact, and barycentric coordinate from which on a contact is inside."""

_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


class BodyBall:
    """Moves the ball of a scene without a maze."""

    def __init__(
        self,
        description: Ball,
        surface: IndexArray,
        frames: tuple[DrivenFrame, ...],
        mass: float,
        gravity: FloatArray,
        loads: NodalLoads,
        *,
        quasi_static: bool,
        disc: IndexArray | None = None,
    ) -> None:
        """Prepare the surfaces.

        Args:
            description: The ball.
            surface: Triangles of the body, shape (m, 3).
            frames: The servo arms; a servo stands under each.
            mass: Of the body [kg].
            gravity: [m/s²], shape (3,).
            loads: Of the system.
            quasi_static: Whether the body has no inertia.
            disc: Nodes of the effector; None without one.

        Raises:
            SceneError: the ball is too heavy.
        """
        if description.mass > mass * HEAVIEST:
            raise SceneError(
                f"ball.mass is {description.mass} kg; on the soft body it must be at most 1/32 of material.mass, "
                f"{mass * HEAVIEST:.4g} kg"
            )
        d = self.description = description
        self._numbers = np.array(
            [d.mass, d.radius, d.friction, d.restitution, d.rest_speed, d.rolling, d.substep, *gravity]
        )
        self._gravity, self.loads, self._quasi_static = gravity, loads, quasi_static
        n = len(loads.force)
        boxes = [_box(frame) for frame in frames]
        self._servos = np.concatenate([*boxes, np.zeros((0, 3))])
        self._slide = len(frames)  # its number among the joints
        self._inward = np.concatenate([*(np.tile(f.inward, (8, 1)) for f in frames), np.zeros((0, 3))])
        tops = [
            [8 * i + n + a, 8 * i + n + b, 8 * i + n + c]
            for i in range(len(frames))
            for p, q, r, s in _FACES
            for a, b, c in ((p, q, r), (p, r, s))
        ]
        self._triangles = np.concatenate([surface, np.array(tops, dtype=np.int64).reshape(-1, 3)])
        self._disc = np.zeros(0, dtype=np.int64) if disc is None else disc
        self._surface, self._weight = surface, description.mass * float(np.linalg.norm(gravity))
        self._before, self._after = np.zeros((2, n + len(self._servos), 3))
        self._reaction = np.zeros_like(self._before)
        self._scratch = workspace(len(self._triangles))

    def _corners(self, state: State, out: FloatArray) -> None:
        n = len(state.positions)
        out[:n] = state.positions
        out[n:] = self._servos + state.joints[self._slide] * self._inward

    def start(self, state: State) -> BallState:
        """Return the ball at rest where the scene puts it. Raises SceneError if it overlaps something."""
        numbers = np.zeros(13)
        numbers[:3], numbers[12] = self.description.position, 1.0
        ball = BallState(numbers)
        self._corners(state, self._before)
        gap = self.gap(ball)
        if gap < 0:
            raise SceneError(
                f"ball.position {list(self.description.position)} m: the ball of radius {self.description.radius} m "
                f"overlaps the body or a servo by {-gap:.3g} m; lift it"
            )
        ball.nodal = np.zeros_like(self.loads.force)
        return ball

    def gap(self, ball: BallState) -> float:
        """Return the distance between the ball and the surfaces as they were at the start of the last step [m]."""
        normal, weights = np.zeros(3), np.zeros(3)
        corners = self._before[self._triangles].reshape(-1, 9)
        nearest = min(triangle_distance(t, ball.position, normal, weights) for t in corners)
        return float(nearest - self.description.radius)

    def load(self, state: State, ball: BallState) -> None:
        """Write the loads of a step that begins at `state`, and remember where the surfaces are."""
        self._corners(state, self._before)
        if ball.nodal is not None:
            self.loads.force[:] = ball.nodal

    def follow(self, state: State, ball: BallState, dt: float) -> None:
        """Move `ball` over the step that ended at `state`, in place."""
        force, n = self.loads.force, len(state.positions)
        ball.load_work += float(np.vdot(force, state.positions) - np.vdot(force, self._before[:n]))
        self._corners(state, self._after)
        self._reaction[:] = 0.0
        if ball.place is Place.PLAYING:
            rows, candidates, owners = self._scratch
            advance_on_surface(
                ball.numbers, self._before, self._after, self._triangles, dt, self._numbers, ball.ledger,
                self._reaction, rows, candidates, owners,
            )  # fmt: skip
            if ball.position[2] < -LOST:
                ball.place, ball.lost_time = Place.LEFT, state.time
        elif ball.position[2] > -ABYSS:
            fall(ball.numbers, dt, self._gravity)
        if ball.nodal is not None:
            share = min(1.0, dt / AVERAGE) if self._quasi_static else 1.0
            ball.nodal *= 1 - share
            ball.nodal += (share / dt) * self._reaction[:n]

    def rest_load(
        self, state: State, ball: BallState, out: FloatArray
    ) -> list[tuple[IndexArray, FloatArray]]:
        """Write the static load of the ball on the nodes [N], shape (n, 3); return what stiffness of its own it has.

        It is what the ball presses with, up to its weight: an impact is no state of rest. The corners of the triangles
        that it touches carry it; where it lies on a single one, the contact moves as that tilts. Where the effector
        holds the ball from three sides at least (it sits in the hole) it goes along, its weight acting at its centre.

        Returns:
            Nodes, shape (3,), and stiffness between them [N/m], shape (9, 9), of each contact that has one.
        """
        out[:] = 0.0
        if ball.nodal is None or ball.place is not Place.PLAYING:
            return []
        found, most = float(np.linalg.norm(ball.nodal.sum(axis=0))), self._weight
        out[:] = ball.nodal * (most / found if found > most else 1.0)
        contacts = self._contacts(state, ball)
        if len(contacts) >= 3 and all(np.isin(nodes, self._disc).all() for nodes, _, _ in contacts):
            centre = state.centres[0]
            arms, force = state.positions[self._disc] - centre, out[self._disc].sum(axis=0)
            out[self._disc] = carried(arms, ball.position - centre, force)
        if len(contacts) != 1 or contacts[0][2].min() < INSIDE:
            return []
        nodes, normal, _ = contacts[0]
        corners, radius = state.positions[nodes], self.description.radius
        return [(nodes, rolling_stiffness(corners, normal, radius, out[nodes].sum(axis=0)))]

    def _contacts(self, state: State, ball: BallState) -> list[tuple[IndexArray, FloatArray, FloatArray]]:
        """Return nodes, normal and barycentric coordinates of where the body touches the ball, each normal once."""
        reach, triangles = self.description.radius + SKIN + TOUCHES, self._surface
        corners, x = state.positions[triangles], ball.position
        far = np.maximum(corners.min(axis=1) - x, x - corners.max(axis=1)).max(axis=1)
        contacts: list[tuple[IndexArray, FloatArray, FloatArray]] = []
        for k in np.flatnonzero(far <= reach):
            normal, weights = np.zeros(3), np.zeros(3)
            touches = triangle_distance(corners[k].reshape(9), x, normal, weights) <= reach
            if touches and all(float(normal @ other) < SAME for _, other, _ in contacts):
                contacts.append((triangles[k], normal, weights))
        return contacts

    def energy(self, ball: BallState) -> float:
        """Return kinetic and potential energy of the ball [J], the latter zero at the origin."""
        d, v, w = self.description, ball.velocity, ball.spin
        kinetic = 0.5 * d.mass * float(v @ v) + 0.2 * d.mass * d.radius**2 * float(w @ w)
        return kinetic - d.mass * float(self._gravity @ ball.position)


def _box(frame: DrivenFrame) -> FloatArray:
    """Return the corners of the servo under an arm, its slide being 0 [m], shape (8, 3)."""
    length, width, height = SERVO
    corners = [
        frame.point + a * frame.axis + b * frame.inward + c * np.array([0.0, 0.0, 1.0])
        for a in (-length / 2, length / 2)
        for b in (-width / 2, width / 2)
        for c in (-height, 0.0)
    ]
    return np.array(corners)
