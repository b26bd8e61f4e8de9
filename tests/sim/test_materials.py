"""Every material: energy, stress and tangent agree; frames do not matter; projection projects."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.checks import (
    Law,
    assert_derivative,
    assert_gradient,
    assert_symmetric,
    law_vector,
    random_rotation,
)
from tests.messages import raises_naming
from tripod_sim.errors import SceneError
from tripod_sim.materials import calls
from tripod_sim.materials.lame import lame_constants
from tripod_sim.materials.laws import NAMES, corotational
from tripod_sim.materials.spectral import eigen3, svd3


@pytest.fixture(params=NAMES)
def law(request: pytest.FixtureRequest) -> Law:
    return Law(request.param)


def deformations(count: int, size: float = 0.25) -> list[np.ndarray]:
    """Gradients with rotations of any size and strains up to about `size`, none inverted."""
    rng = np.random.default_rng(7)
    found = []
    while len(found) < count:
        F = random_rotation(rng) @ (np.eye(3) + size * rng.uniform(-1, 1, (3, 3)))
        if np.linalg.det(F) > 0.3:
            found.append(F)
    return found


@pytest.mark.parametrize("F", deformations(5))
def test_stress_is_the_energy_gradient(law: Law, F: np.ndarray) -> None:
    # central differences: truncation h² and rounding eps/h balance near h = 1e-5 with a relative error of 1e-10
    assert_gradient(law.energy, law.stress(F), F, np.random.default_rng(0), h=1e-5, rel=1e-6)


@pytest.mark.parametrize("F", deformations(5))
def test_tangent_is_the_stress_derivative(law: Law, F: np.ndarray) -> None:
    C = law.tangent(F)
    assert_symmetric(C)
    assert_derivative(law.stress, C, F, np.random.default_rng(1), h=1e-5, rel=1e-7)


def test_rest_is_free_of_stress_and_linearises_to_hooke(law: Law) -> None:
    assert law.energy(np.eye(3)) == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(law.stress(np.eye(3)), 0, atol=1e-9)
    e = np.random.default_rng(2).standard_normal((3, 3))
    strain = (e + e.T) / 2
    hooke = law.lam * np.trace(strain) * np.eye(3) + 2 * law.mu * strain
    np.testing.assert_allclose(law.tangent(np.eye(3)) @ e.ravel(), hooke.ravel(), rtol=1e-9)


@pytest.mark.parametrize("F", deformations(3))
def test_a_rotation_of_the_frame_rotates_the_stress(law: Law, F: np.ndarray) -> None:
    Q = random_rotation(np.random.default_rng(3))
    assert law.energy(Q @ F) == pytest.approx(law.energy(F), rel=1e-11)
    np.testing.assert_allclose(law.stress(Q @ F), Q @ law.stress(F), atol=1e-10 * np.abs(law.stress(F)).max())
    assert law.energy(F @ Q) == pytest.approx(law.energy(F), rel=1e-11)  # isotropy


@pytest.mark.parametrize("F", deformations(6, 0.05))
def test_projection_leaves_a_positive_tangent_as_it_is(law: Law, F: np.ndarray) -> None:
    stretched = F * (1.02 / np.cbrt(np.linalg.det(F)))  # a little volume: every pair eigenvalue is positive
    C = law.tangent(stretched)
    assert np.linalg.eigvalsh(C).min() > 0
    np.testing.assert_allclose(law.tangent(stretched, project=True), C, atol=1e-9 * np.abs(C).max())


def test_projection_keeps_positive_eigenvalues_and_lifts_negative_ones(law: Law) -> None:
    lifted = 0
    for F in [0.7 * F for F in deformations(8)]:
        exact, projected = law.tangent(F), law.tangent(F, project=True)
        assert_symmetric(projected)
        w, v = np.linalg.eigh(exact)
        lifted += int((w < -1e-6 * law.mu).sum())
        nearest = (v * np.maximum(w, 1e-6 * law.mu)) @ v.T
        np.testing.assert_allclose(projected, nearest, atol=1e-7 * np.abs(exact).max())
    assert lifted > 0  # else nothing was tested


@pytest.mark.parametrize("name", ["neo_hooke", "mooney_rivlin", "yeoh", "ogden"])
def test_laws_of_rubber_have_no_energy_inside_out(name: str) -> None:
    law = Law(name)
    for F in (np.diag([1.0, 1.0, -0.1]), np.zeros((3, 3)), np.full((3, 3), np.nan)):
        assert law.energy(F) == np.inf
        assert law.module.stress(F, law.p, np.zeros((3, 3))) == np.inf


@pytest.mark.parametrize(
    "F",
    [
        np.diag([1.0, 1.0, -0.5]),
        np.diag([1.0, 0.0, 0.0]),
        np.zeros((3, 3)),
        -np.eye(3),
        np.diag([1e-12, 1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("name", ["corotational", "stable_neo_hooke", "st_venant_kirchhoff"])
def test_other_laws_survive_inversion_and_collapse(name: str, F: np.ndarray) -> None:
    law = Law(name)
    assert np.isfinite(law.energy(F))
    assert np.isfinite(law.stress(F)).all()
    projected = law.tangent(F, project=True)
    assert np.isfinite(projected).all()
    assert np.linalg.eigvalsh(projected).min() >= -1e-6 * law.mu


@pytest.mark.parametrize("name", ["corotational", "stable_neo_hooke"])
def test_an_inverted_element_is_pulled_back(name: str) -> None:
    law = Law(name)
    F = np.diag([1.0, 1.0, -0.5])
    assert law.stress(F)[2, 2] < 0  # energy falls as F_33 grows towards +1


@given(arrays(float, (3, 3), elements=st.floats(-10, 10, allow_nan=False)))
def test_singular_value_decomposition(F: np.ndarray) -> None:
    U, s, V = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    svd3(F, U, s, V)
    size = max(np.abs(F).max(), 1e-30)
    np.testing.assert_allclose(U @ np.diag(s) @ V.T, F, atol=1e-13 * size)
    for R in (U, V):
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-13)
        assert np.linalg.det(R) == pytest.approx(1)
    assert s[0] >= s[1] >= abs(s[2]) - 1e-14 * size
    np.testing.assert_allclose(np.abs(s), np.linalg.svd(F, compute_uv=False), atol=1e-13 * size)


@given(arrays(float, (3, 3), elements=st.floats(-10, 10, allow_nan=False)))
def test_symmetric_eigenvalues(A: np.ndarray) -> None:
    A = A + A.T
    w, Q = np.zeros(3), np.zeros((3, 3))
    eigen3(A.copy(), w, Q)
    np.testing.assert_allclose(Q @ np.diag(w) @ Q.T, A, atol=1e-13 * max(np.abs(A).max(), 1e-30))


@pytest.mark.parametrize(
    ("young", "poisson", "word"),
    [
        (0, 0.3, "young is 0"),
        (-1, 0.3, "young is -1"),
        (np.nan, 0.3, "young is nan"),
        (1, 0.5, "poisson is 0.5"),
        (1, np.nan, "poisson is nan"),
    ],
)
def test_bad_constants_are_named(young: float, poisson: float, word: str) -> None:
    with raises_naming(SceneError, word):
        lame_constants(young, poisson)


def test_lame_constants_of_a_hand_worked_case() -> None:
    lam, mu = lame_constants(2.6, 0.3)
    assert (lam, mu) == (pytest.approx(1.5), pytest.approx(1.0))


@pytest.mark.parametrize("project", [False, True])
def test_corotational_tangent_is_that_of_the_singular_values(project: bool) -> None:
    """Two ways to one matrix: by the polar rotation and its derivative, and by singular values and vectors."""
    rng, quick, spectral = np.random.default_rng(3), np.empty((9, 9)), np.empty((9, 9))
    law, p, usual = Law("corotational").law, law_vector("corotational", 3.0, 1.0), 0
    for _ in range(300):
        F = random_rotation(rng) @ (np.eye(3) + rng.uniform(0, 0.8) * rng.normal(size=(3, 3)))
        usual += corotational.polar_rotation(F, np.empty((3, 3)))
        calls.tangent(law, F, p, project, quick)
        calls.spectral_tangent(law, F, 0.0, True, p, project, spectral)
        np.testing.assert_allclose(quick, spectral, atol=1e-12 * np.abs(spectral).max())
    assert 150 < usual < 300  # both branches were taken
