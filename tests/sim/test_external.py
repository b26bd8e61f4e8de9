"""Problems that others have set: the published values come out. All of them: benchmarks/external.py."""

from types import SimpleNamespace

import pytest

from benchmarks import external


@pytest.mark.parametrize("element", ["t10", "h20", "h27"])
def test_quadratic_elements_find_the_target_stress_of_an_elliptic_membrane(element: str) -> None:
    assert external.le1(element) == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_a_thick_plate_bends_as_the_target_says() -> None:
    assert external.le10("h20") == pytest.approx(1.0, abs=0.01)


def test_the_table_of_elements_tells_errors_and_times_over_those_of_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = SimpleNamespace(now=5.0, process_time=lambda: clock.now)

    def burnt(element: str) -> float:
        clock.now += 0.25 if element == "h8_modes" else 0.75
        return 1.025 if element == "t4" else 1.0

    monkeypatch.setattr(external, "time", clock)
    monkeypatch.setitem(external.SOLIDS, "burnt", burnt)
    row = external.solids_table(["burnt"], rounds=2)[-1].strip("| ").split(" | ")
    assert row[:2] == ["burnt", "+0.00, 1 x"]
    assert row[-1] == "+2.50, 3 x"
    assert [cell.split(", ")[1] for cell in row[2:]] == ["3 x"] * 7


@pytest.mark.parametrize("element", ["h8_modes", "h20", "t10"])
def test_a_slender_cantilever_bends_like_the_elastica(element: str) -> None:
    assert external.elastica() == pytest.approx((0.714, 0.388), abs=5e-4)  # printed values
    assert external.cantilever(element) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("element", ["h8_modes", "h8_mean", "h20"])
def test_nearly_incompressible_a_tapered_panel_does_not_lock(element: str) -> None:
    assert external.cook_incompressible(element) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("scheme", ["semi_implicit_euler", "rk4", "bdf2", "tr_bdf2"])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(scheme: str) -> None:
    assert external.period(scheme, 1e-3)[0] == pytest.approx(1.0, abs=1e-4)


def test_a_rope_hangs_as_a_catenary() -> None:
    assert external.catenary() == pytest.approx(1.0, abs=5e-4)


def test_a_block_sticks_from_the_tangent_of_its_angle_on() -> None:
    assert external.threshold() == pytest.approx(1.0, abs=2e-3)


def test_a_ball_that_slides_ends_up_rolling_at_five_sevenths_of_its_speed() -> None:
    assert external.rolling() == pytest.approx(1.0, abs=1e-4)


def test_a_ball_presses_a_block_as_hertz_says() -> None:
    assert external.hertz(2, 2.0, 15.0) == pytest.approx(
        1.0, abs=0.06
    )  # two cells along the contact's radius


def test_in_a_pile_nothing_passes_and_hardly_any_energy_is_won() -> None:
    found = external.pile(27)
    assert found.gap > 0
    assert found.rise < 1e-4  # of the energy lost: what contact.tolerance leaves


def test_a_column_twists_as_saint_venant_says() -> None:
    assert external.column("h20") == pytest.approx(1.0, abs=2e-3)
