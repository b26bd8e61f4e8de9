"""Rotations in numpy and compiled ones against scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tripod_host import rotations
from tripod_sim import rotation_kernels as kernels

SIZES = (0.0, 1e-9, 1e-5, 1e-3, 0.1, 1.0, 3.0, np.pi)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("seed", range(3))
def test_all_forms_of_a_rotation_agree(size: float, seed: int) -> None:
    direction = np.random.default_rng(seed).standard_normal(3)
    vector = size * direction / np.linalg.norm(direction)
    expected = Rotation.from_rotvec(vector)
    q, matrix, compiled = (
        rotations.vector_quaternion(vector),
        rotations.rotation_matrix(vector),
        np.empty((3, 3)),
    )
    kernels.turned(vector, np.eye(3), compiled)
    np.testing.assert_allclose(q, expected.as_quat(), atol=1e-15)
    np.testing.assert_allclose(matrix, expected.as_matrix(), atol=2e-15)
    np.testing.assert_allclose(compiled, expected.as_matrix(), atol=2e-15)
    np.testing.assert_allclose(rotations.quaternion_matrix(-0.3 * q), matrix, atol=2e-15)
    np.testing.assert_allclose(rotations.quaternion(matrix) * np.sign(q[3]), q, atol=1e-12)
    assert rotations.quaternion_angle(-q) == pytest.approx(size, abs=1e-14)
    if size < np.pi:  # there a vector and its opposite turn alike
        np.testing.assert_allclose(rotations.rotation_vector(matrix), vector, atol=1e-12)


@pytest.mark.parametrize("axis", np.eye(3))
def test_a_half_turn_has_a_quaternion(axis: np.ndarray) -> None:
    q = rotations.quaternion(rotations.rotation_matrix(axis * np.pi))
    np.testing.assert_allclose(np.abs(q), np.append(axis, 0), atol=1e-12)


def test_a_product_turns_by_the_second_first() -> None:
    first, second = Rotation.random(4, random_state=1), Rotation.random(4, random_state=2)
    product = rotations.quaternion_product(first.as_quat(), second.as_quat())
    turned = [rotations.quaternion_matrix(q) for q in product]
    np.testing.assert_allclose(turned, (first * second).as_matrix(), atol=1e-15)
    alone = rotations.quaternion_product(first.as_quat()[0], second.as_quat())
    np.testing.assert_array_equal(alone[0], product[0])


def test_kernels_turn_vectors_tensors_and_quaternions() -> None:
    rng = np.random.default_rng(3)
    a, b, w, T = *rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
    R, out, q = Rotation.random(random_state=4), np.empty(3), Rotation.random(random_state=5).as_quat()
    kernels.cross(a, b, out)
    np.testing.assert_allclose(out, rotations.skew(a) @ b, atol=1e-15)
    np.testing.assert_allclose(rotations.axial(np.outer(a, b)), out, atol=1e-15)
    kernels.rotate(R.as_matrix(), a, out)
    np.testing.assert_allclose(out, R.apply(a), atol=1e-15)
    kernels.rotate_back(R.as_matrix(), a, out)
    np.testing.assert_allclose(out, R.inv().apply(a), atol=1e-15)
    kernels.carried(R.as_matrix(), T, a, out)
    np.testing.assert_allclose(out, R.as_matrix() @ T @ R.as_matrix().T @ a, atol=1e-14)
    expected = Rotation.from_rotvec(0.2 * w) * Rotation.from_quat(q)
    kernels.turn(q, w, 0.2)
    np.testing.assert_allclose(rotations.quaternion_matrix(q), expected.as_matrix(), atol=1e-15)


@pytest.mark.parametrize("size", [1e-4, 0.5, 2.0])
def test_the_rate_of_a_rotation_vector_turns_with_the_spin(size: float) -> None:
    rng = np.random.default_rng(6)
    p, w, rate = rng.standard_normal(3), rng.standard_normal(3), np.empty(3)
    p *= size / np.linalg.norm(p)
    kernels.rotation_rate(p, w, rate)
    ahead, behind = (
        (Rotation.from_rotvec(s * w) * Rotation.from_rotvec(p)).as_rotvec() for s in (1e-5, -1e-5)
    )
    np.testing.assert_allclose(rate, (ahead - behind) / 2e-5, atol=1e-8)
