"""What every member of a family must satisfy, written once."""

from collections.abc import Callable

import numpy as np
import pytest

from tripod_host.arrays import FloatArray
from tripod_runtime.checkpoint import Checkpoint, checkpoint_bytes
from tripod_sim import Simulation, StepError
from tripod_sim.integrators.integrator import Integrator


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """Return a rotation matrix, uniformly distributed."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, ::-1]


def assert_gradient(
    function: Callable[[FloatArray], float],
    gradient: FloatArray,
    x: FloatArray,
    rng: np.random.Generator,
    *,
    h: float,
    rel: float,
) -> None:
    """Compare a gradient at `x` with central differences of `function` along three random directions."""
    assert np.abs(gradient).max() > 0  # a gradient of zero would pass with any sign
    for _ in range(3):
        d = rng.standard_normal(x.shape)
        slope = (function(x + h * d) - function(x - h * d)) / (2 * h)
        assert slope == pytest.approx(float(np.vdot(gradient, d)), rel=rel)


def assert_derivative(
    function: Callable[[FloatArray], FloatArray],
    matrix: FloatArray,
    x: FloatArray,
    rng: np.random.Generator,
    *,
    h: float,
    rel: float,
) -> None:
    """Compare matrix-vector products at `x` with central differences of `function` along three random directions."""
    for _ in range(3):
        d = rng.standard_normal(x.shape)
        difference = (function(x + h * d) - function(x - h * d)).ravel() / (2 * h)
        product = matrix @ d.ravel()
        assert np.abs(product).max() > 0
        np.testing.assert_allclose(difference, product, rtol=0, atol=rel * np.abs(product).max())


def assert_symmetric(matrix: FloatArray, rel: float = 1e-12) -> None:
    """Check symmetry to rounding."""
    np.testing.assert_allclose(matrix, matrix.T, rtol=0, atol=rel * np.abs(matrix).max())


def law_vector(law: str, lam: float, mu: float) -> FloatArray:
    """Return parameters of any law that for small strains has Lame's constants [Pa]; its own are of mixed size."""
    from tripod_sim.materials.law import law_named, vector

    found = law_named(law)
    if not found.PARAMETERS:
        return vector(law, lam, mu)
    own = np.array([1.0, 1.7, -0.4, -2.3, 0.05, 5.1])[: found.COUNTS[-1]]
    moduli = np.array([name.endswith("[Pa]") for name in found.PARAMETERS])
    return vector(law, lam, mu, tuple(np.where(moduli, own * mu / found.shear(tuple(own)), own)))


class Law:
    """A material's compiled functions behind plain Python calls, for tests."""

    def __init__(self, name: str, young: float = 250e3, poisson: float = 0.45) -> None:
        from tripod_sim.materials import calls
        from tripod_sim.materials.lame import lame_constants
        from tripod_sim.materials.law import law_named

        self.module, self.tangents = law_named(name), calls.tangent
        self.law = calls.addresses(self.module)
        self.lam, self.mu = lame_constants(young, poisson)
        self.p = law_vector(name, self.lam, self.mu)

    def energy(self, F: FloatArray) -> float:
        return float(self.module.stress(np.ascontiguousarray(F), self.p, np.zeros((3, 3))))

    def stress(self, F: FloatArray) -> FloatArray:
        P = np.zeros((3, 3))
        self.module.stress(np.ascontiguousarray(F), self.p, P)
        return P

    def tangent(self, F: FloatArray, *, project: bool = False) -> FloatArray:
        C = np.zeros((9, 9))
        self.tangents(self.law, np.ascontiguousarray(F), self.p, project, C)
        return C


def assert_failing_leaves_the_state(
    simulation: Simulation, stepper: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step in which `stepper`, a part of what makes it, fails says so and leaves all of the state."""

    def fail(state: object, joints: object, dt: float) -> None:
        raise StepError("no way")

    for name in ("advance", "advance_truncated") if isinstance(stepper, Integrator) else ("step",):
        monkeypatch.setattr(stepper, name, fail)
    before = simulation.save()[0]
    with pytest.raises(StepError, match="no way"):
        simulation.step()
    assert checkpoint_bytes(Checkpoint(0, simulation.state, simulation.efforts)) == checkpoint_bytes(
        Checkpoint(0, before, simulation.efforts)
    )
