"""The hexahedron: nodality, volumes, and what incompatible modes must and must not do."""

import numpy as np
import pytest

from tests.checks import random_rotation
from tripod_sim.elements.hexahedron import (
    CORNERS,
    h8_gradients,
    h8_node_volumes,
    shape_functions,
    shape_gradients,
)
from tripod_sim.forces.solid import Solid

CUBE = (CORNERS + 1) / 2


def distorted(rng: np.random.Generator, size: float = 0.15) -> np.ndarray:
    return CUBE + rng.uniform(-size, size, (8, 3))


def test_one_at_its_own_node_and_zero_at_the_others() -> None:
    np.testing.assert_allclose(shape_functions(CORNERS), np.eye(8), atol=1e-15)


def test_shape_gradients_are_derivatives_and_sum_to_zero() -> None:
    xi, h = np.random.default_rng(0).uniform(-1, 1, (5, 3)), 1e-6
    for j in range(3):
        step = h * np.eye(3)[j]
        slope = (shape_functions(xi + step) - shape_functions(xi - step)) / (2 * h)
        np.testing.assert_allclose(shape_gradients(xi)[:, :, j], slope, atol=1e-9)
    np.testing.assert_allclose(shape_gradients(xi).sum(axis=1), 0, atol=1e-15)


def test_gradients_reproduce_a_linear_field_and_modes_average_to_zero() -> None:
    rng = np.random.default_rng(1)
    corners = distorted(rng)[None]
    gradients, weight = h8_gradients(corners)
    A = rng.standard_normal((3, 3))
    u = corners[0] @ A.T
    found = np.einsum("ai,qaj->qij", u, gradients[0, :, :8])
    np.testing.assert_allclose(found, np.tile(A, (8, 1, 1)), atol=1e-12)
    mean = np.einsum("q,qkj->kj", weight[0], gradients[0, :, 8:])
    np.testing.assert_allclose(
        mean, 0, atol=1e-13
    )  # so the modes do no work on constant stress: the patch test
    assert np.abs(gradients[0, :, 8:]).max() > 1


def test_lumped_volumes_sum_to_the_volume_of_a_skewed_brick() -> None:
    A = np.array([[2.0, 0.3, 0.1], [0.0, 1.5, 0.2], [0.0, 0.0, 0.7]])
    volumes = h8_node_volumes((CUBE @ A.T)[None])
    assert volumes.sum() == pytest.approx(np.linalg.det(A))
    np.testing.assert_allclose(volumes, np.linalg.det(A) / 8)  # affine: all nodes alike


def patch() -> tuple[np.ndarray, np.ndarray]:
    """Eight distorted elements around one inner node."""
    grid = np.stack(np.meshgrid(*[np.arange(3.0)] * 3, indexing="ij"), -1).reshape(-1, 3)
    nodes = grid + np.random.default_rng(5).uniform(-0.15, 0.15, grid.shape)
    n = np.arange(27).reshape(3, 3, 3)
    elements = [
        [n[i + a, j + b, k + c] for a, b, c in ((CORNERS + 1) // 2).astype(int)]
        for i in range(2) for j in range(2) for k in range(2)
    ]  # fmt: skip
    return nodes, np.array(elements)


@pytest.mark.parametrize("law", ["neo_hooke", "corotational"])
def test_patch_of_distorted_elements_holds_a_large_uniform_strain(law: str) -> None:
    nodes, elements = patch()
    solid = Solid(nodes, elements, law, 1.0, 1.0)
    F = random_rotation(np.random.default_rng(6)) @ np.array(
        [[1.3, 0.2, 0.0], [0.1, 0.9, 0.1], [0.0, 0.2, 1.1]]
    )
    x, modes, g = nodes @ F.T, solid.rest_modes(), np.zeros_like(nodes)
    assert solid.stiffness(x, modes, project=True) == -1
    solid.add_gradient(x, modes, g)
    assert np.abs(g).max() > 0.1
    np.testing.assert_allclose(g[13], 0, atol=1e-12)  # the inner node is in equilibrium
    assert solid.mode_residual_squared < 1e-24  # and the modes stay at rest


def test_bending_of_one_layer_does_not_lock() -> None:
    """A cantilever of one element through the thickness bends as a beam: tip load against P L³ / (3 E I)."""
    length, height, count, E = 10.0, 0.5, 10, 1000.0
    grid = np.stack(
        np.meshgrid(np.linspace(0, length, count + 1), [0.0, height], [0.0, height], indexing="ij"), -1
    )
    nodes = grid.reshape(-1, 3)
    n = np.arange(len(nodes)).reshape(count + 1, 2, 2)
    elements = np.array(
        [[n[i + a, b, c] for a, b, c in ((CORNERS + 1) // 2).astype(int)] for i in range(count)]
    )
    solid = Solid(
        nodes, elements, "neo_hooke", 0.0, E / 2
    )  # nu = 0: no anticlastic effect, beam theory is exact
    solid.stiffness(nodes.copy(), solid.rest_modes(), project=False)
    K = np.zeros((len(nodes) * 3,) * 2)
    for e, k in zip(elements, solid.matrices, strict=True):
        dofs = (3 * e[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += k
    load, free = np.zeros(len(nodes) * 3), np.arange(12, len(nodes) * 3)
    load[3 * n[-1].ravel() + 2] = 0.25
    u = np.zeros(len(load))
    u[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    inertia = height**4 / 12
    shear = length / (5 / 6 * (E / 2) * height**2)  # Timoshenko
    assert u[3 * n[-1, 0, 0] + 2] == pytest.approx(length**3 / (3 * E * inertia) + shear, rel=0.01)
