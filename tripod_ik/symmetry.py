"""Rotations and reflections that take a robot onto itself, its servos onto each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tripod_host.arrays import FloatArray
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask, Task, TiltTask


@dataclass(frozen=True, eq=False)
class Image:
    """What a pose looks like, turned or mirrored.

    Attributes:
        matrix: M, orthogonal, shape (3, 3).
        servos: The servo whose angle the image's servo i has, shape (n,).
    """

    matrix: FloatArray
    servos: NDArray[np.intp]

    @property
    def trivial(self) -> bool:
        """Whether it is the pose itself."""
        return bool((self.servos == np.arange(len(self.servos))).all())

    def of(self, other: "Image") -> "Image":
        """Return the image of an image."""
        return Image(self.matrix @ other.matrix, other.servos[self.servos])

    def back(self, angles: FloatArray) -> FloatArray:
        """Return the angles whose image `angles`, shape (n,), are."""
        before = np.empty_like(angles)
        before[self.servos] = angles
        return before

    def state(self, state: LinearState) -> LinearState:
        """Return the image of a state.

        Vectors v become M v, axial ones (of rotations and torques) det(M) M v; with T of both and of the order of the
        servos W becomes T W Tᵀ.
        """
        if self.trivial:
            return state
        M, n = self.matrix, len(self.servos)
        axial = np.linalg.det(M) * M
        T = np.zeros((6 + n, 6 + n))
        T[:3, :3], T[3:6, 3:6] = M, axial
        T[6 + np.arange(n), 6 + self.servos] = 1.0
        return replace(
            state,
            angles=state.angles[self.servos],
            efforts=state.efforts[self.servos],
            effector=M @ state.effector,
            rotation=np.append(axial @ state.rotation[:3], state.rotation[3]),
            equilibrium_offset=T[:6, :6] @ state.equilibrium_offset,
            W=T @ state.W @ T.T,
            stability_margin_slope=state.stability_margin_slope[self.servos],
        )

    def task(self, task: Task) -> Task | None:
        """Return the image of a task; None where it has none."""
        if isinstance(task, PositionTask) and task.weights[0] == task.weights[1] and not task.place:
            return replace(task, target=self.matrix @ task.target)
        if isinstance(task, TiltTask):
            return replace(task, normal=self.matrix @ task.normal)
        return None

    def names(self, names: Sequence[str], servos: Sequence[str]) -> tuple[str, ...]:
        """Return what limits `names`, such as "servo_0 torque", of the image are of the pose; `servos`: their names."""
        before = {servo: servos[i] for servo, i in zip(servos, self.servos, strict=True)}
        words = (name.split(" ", 1) for name in names)
        return tuple(" ".join((before.get(first, first), *rest)) for first, *rest in words)


def images(count: int, *, mirrored: bool) -> list[Image]:
    """Return the images of a robot with `count` servos evenly about Z, the first along X; the pose itself first."""
    found = []
    for flip in (1, -1) if mirrored else (1,):
        for k in range(count):
            c, s = np.cos(2 * np.pi * k / count), np.sin(2 * np.pi * k / count)
            matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, flip, 1.0])
            found.append(Image(matrix, (flip * (np.arange(count) - k)) % count))
    return found


def table(group: Sequence[Image]) -> NDArray[np.intp]:
    """Return which image of a group, closed, `group[i].of(group[j])` is, shape (len, len)."""
    matrices = np.array([image.matrix for image in group])
    products = np.einsum("iab,jbc->ijac", matrices, matrices)
    away = np.abs(products[:, :, None] - matrices).max(axis=(-1, -2))
    return np.asarray(away.argmin(axis=-1))
