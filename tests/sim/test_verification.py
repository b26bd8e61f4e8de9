"""Analytic cases and an independent code, as far as they fit a test; benchmarks/verification.py has them all."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from benchmarks import analytic, calculix
from tests.messages import raises_naming

BENDING = ("h8_modes", "t10", "h20", "h20_full", "h27")
ALL = (*BENDING, "h8", "h8_mean", "t4")


@pytest.mark.parametrize("element", ALL)
def test_an_even_strain_loads_no_inner_node(element: str) -> None:
    assert analytic.patch(element) < 1e-12  # rounding: some hundred products of size 1


@pytest.mark.parametrize("element", ALL)
def test_a_rigid_motion_makes_no_force(element: str) -> None:
    assert analytic.rigid(element) < 1e-12


@pytest.mark.parametrize("element", BENDING)
def test_the_deflection_of_a_cantilever_converges_to_timoshenko_s(element: str) -> None:
    """The clamp holds the warping of its section, which beam theory lets go: an effect of order (h/L)² = 0.25 %."""
    coarse, fine = (abs(analytic.deflection(element, cells) - 1) for cells in (10, 20))
    assert coarse < 4e-3
    assert fine < 2.5e-3
    assert fine < coarse


def test_linear_elements_lock_in_bending() -> None:
    """So nobody takes them for verified. The excess stiffness of H8 is (l/h)² at length l: it falls fourfold."""
    excess = {e: [1 / analytic.deflection(e, cells) - 1 for cells in (10, 20)] for e in ("h8", "t4")}
    assert excess["h8"][0] / excess["h8"][1] == pytest.approx(4.0, rel=0.1)
    assert excess["t4"][0] > excess["h8"][0] > 1.5


@pytest.mark.parametrize("element", BENDING)
def test_the_first_frequency_of_a_cantilever_is_timoshenko_s(element: str) -> None:
    """Ten elements to a quarter wave: lumped masses and one-layer stiffness each err by less than (h/L)²."""
    assert analytic.frequency(element) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize("element", ["h8_modes", "h20"])
def test_a_column_buckles_at_euler_s_load(element: str) -> None:
    assert analytic.buckling(element) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize(
    ("element", "bound"), [("h8_modes", 1 / 16), ("t10", 1 / 256), ("h20", 1 / 256), ("h27", 1 / 256)]
)
def test_the_torsion_of_a_bar_is_saint_venant_s(element: str, bound: float) -> None:
    """Linear interpolation of the warping errs with (1/4)², quadratic with (1/4)⁴."""
    assert analytic.torsion(element) == pytest.approx(1.0, abs=bound)


def test_the_torsion_error_falls_with_the_mesh() -> None:
    errors = np.array([analytic.torsion("h8_modes", cells) - 1 for cells in (2, 4)])
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)


def test_free_flight_keeps_momentum_and_almost_all_energy() -> None:
    """Solver tolerance 1e-7 N over 0.5 s, against 0.57 kg m/s: linear momentum to 1e-7. TR-BDF2 errs by O(h²)."""
    coarse, fine = (np.array(analytic.flight("h8_modes", steps)) - 1 for steps in (125, 250))
    assert fine[0] < 1e-7
    assert fine[1] < 1e-3
    assert -1e-2 < fine[2] <= 1e-6
    assert coarse[1] / fine[1] > 3.0
    assert coarse[2] / fine[2] > 3.0


def needs_calculix(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that runs the independent code CalculiX."""
    return pytest.mark.slow(pytest.mark.skipif(not calculix.installed(), reason=calculix.PACKAGE)(test))


@needs_calculix
@pytest.mark.parametrize(
    ("case", "element"),
    [
        ("L1", "t4"),
        ("L1", "t10"),
        ("L1", "h20"),
        ("L1", "h20_full"),
        ("L2", "t4"),
        ("L4", "t4"),
        ("L5", "t4"),
    ],
)
def test_calculix_agrees(case: str, element: str, tmp_path: Path) -> None:
    found = calculix.agreement(case, element, 1, tmp_path)
    assert found.reached == 1.0
    assert found.size > 3e-4  # [m]: something moved
    assert found.nodes < 1e-5  # CalculiX prints seven digits and stops at its own residual
    assert found.disc < 1e-5


@needs_calculix
def test_calculix_would_disagree_with_another_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison sees a difference of 1 % in one constant."""
    monkeypatch.setattr(calculix, "lame_constants", lambda young, poisson: lame(young * 1.01, poisson))
    found = calculix.agreement("L1", "h20", 1, tmp_path)
    assert found.disc > 1e-3


@needs_calculix
def test_calculix_would_disagree_with_another_clamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness = calculix.bedding
    monkeypatch.setattr(calculix, "bedding", lambda *given: 1.1 * stiffness(*given))
    assert calculix.agreement("L5", "t4", 1, tmp_path).nodes > 1e-3


def lame(young: float, poisson: float) -> tuple[float, float]:
    from tripod_sim.materials.lame import lame_constants

    return lame_constants(young, poisson)


def test_without_calculix_the_message_names_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with raises_naming(calculix.CalculixError, "install", "calculix-ccx"):
        calculix.agreement("L1", "t4", 1, tmp_path)
