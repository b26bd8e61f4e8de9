"""A robot with an exact compliance, to test inverse kinematics on: three arms, each pulling a point by a spring.

With b_i(α_i) the tips, p the effector, θ its rotation and α the angles, its energy is

    E(p, θ, α) = Σ k (|p - b_i| - L)² / 2  +  m g p_z  +  k_r |θ - C α|² / 2.

Gradient and second derivatives are written out, so W = (d²E)⁻¹ is exact and symmetric, and finite differences of the
equilibrium are an independent check of it. Sizes are those of the Tripod: arms of 30 mm that tip outward and down with
negative angles, tips at a radius of 50 mm at zero, torques up to some 0.1 N m.
"""

from dataclasses import dataclass, field

import numpy as np

from tripod_graph.names import SERVOS
from tripod_host.arrays import FloatArray
from tripod_ik.state import LinearState

GRAVITY = 9.81


@dataclass
class SpringRobot:
    """Attributes: slide [m], stiffness k [N/m], rest length L [m], mass m [kg], k_r [N m/rad] and C as above."""

    slide: float = 0.0
    k: float = 40.0
    L: float = 0.015
    m: float = 0.032
    k_r: float = 0.05
    C: FloatArray = field(
        default_factory=lambda: np.array([[0.3, -0.2, 0.1], [0.1, 0.2, -0.3], [0.05, 0.05, 0.05]])
    )
    _last: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, -0.005]), init=False, repr=False)

    def tips(self, angles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return b, db/dα and d²b/dα² of the three tips, each of shape (3, 3), one row a tip."""
        azimuth = 2 * np.pi / 3 * np.arange(3)
        outward = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(3)], axis=1)
        up = np.array([0.0, 0.0, 1.0])
        u, z, c, s = -0.01, 0.02885, np.cos(angles), np.sin(angles)
        arm = (u * c - z * s)[:, None] * outward + (u * s + z * c)[:, None] * up
        turned = (-u * s - z * c)[:, None] * outward + (u * c - z * s)[:, None] * up
        return (0.06 - self.slide) * outward - 0.02885 * up + arm, turned, -arm

    def gradient(self, p: FloatArray, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return dE/dp [N] and dE/dα [N m], each of shape (3,), with the rotation in equilibrium."""
        tips, turned, _ = self.tips(angles)
        d = p - tips
        pull = self.k * (1 - self.L / np.linalg.norm(d, axis=1))[:, None] * d
        weight = np.array([0.0, 0.0, self.m * GRAVITY])
        return pull.sum(axis=0) + weight, -np.sum(pull * turned, axis=1)

    def hessian(self, p: FloatArray, angles: FloatArray) -> FloatArray:
        """Return the second derivatives of E by (p, θ, α), shape (9, 9)."""
        tips, turned, arms = self.tips(angles)
        A = np.zeros((9, 9))
        for i in range(3):
            d = p - tips[i]
            length = np.linalg.norm(d)
            pull = self.k * (1 - self.L / length) * d
            H = self.k * ((1 - self.L / length) * np.eye(3) + self.L / length**3 * np.outer(d, d))
            A[:3, :3] += H
            A[:3, 6 + i] = -H @ turned[i]
            A[6 + i, 6 + i] = turned[i] @ H @ turned[i] - pull @ arms[i]
        A[3:6, 3:6] = self.k_r * np.eye(3)
        A[3:6, 6:] = -self.k_r * self.C
        A[6:, 6:] += self.k_r * self.C.T @ self.C
        A[6:, :6] = A[:6, 6:].T
        return A

    def rest(self, angles: FloatArray) -> FloatArray:
        """Return the equilibrium of the effector [m], shape (3,), by Newton's method from the last one asked for.

        There is only one: the springs are shorter than any distance between their ends here, so E is convex in p.
        """
        p = self._last
        for _ in range(200):
            force = self.gradient(p, angles)[0]
            step = np.linalg.solve(self.hessian(p, angles)[:3, :3], force)
            p = p - min(1.0, 0.01 / max(np.linalg.norm(step), 1e-30)) * step
            if np.linalg.norm(step) < 1e-15:
                break
        assert np.linalg.norm(self.gradient(p, angles)[0]) < 1e-10
        self._last = p
        return p.copy()

    def state(self, angles: FloatArray, effector: FloatArray | None = None) -> LinearState:
        """Return the linearised state at rest, or with the effector held somewhere else [m]."""
        angles = np.asarray(angles, float)
        p = self.rest(angles) if effector is None else effector
        force, torques = self.gradient(p, angles)
        A = self.hessian(p, angles)
        W = np.linalg.inv(A)
        offset = np.zeros(6)
        offset[:3] = -np.linalg.solve(A[:3, :3], force)
        return LinearState(SERVOS, angles, torques, p, np.array([0, 0, 0, 1.0]), offset, (W + W.T) / 2)
