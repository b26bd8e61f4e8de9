"""The table of what `dt = "auto"` costs where bodies touch: which fixed step it is held against."""

from typing import Any

import pytest

from benchmarks.contact_accuracy import ACCURACIES, one_step


def case(*ladder: tuple[int, float, float], own: float = 0.0, apart: float = 0.0) -> dict[str, Any]:
    """Return a case with fixed steps of BDF2 as (division, error, seconds)."""
    fixed = [{"scheme": "bdf2", "division": d, "error": e, "seconds": s} for d, e, s in ladder]
    auto = {
        str(a): {"error": 0.01, "seconds": 3.0, "apart": apart, "grew": 0.0, "deep": 0.0, "speed": 0.0}
        for a in ACCURACIES
    }
    return {"own": own, "moved": 1.0, "exact": {"speed": 1.0}, "fixed": fixed, "auto": auto}


def test_the_one_step_keeps_the_accuracy_in_nearly_all_cases_not_in_each_the_cheapest() -> None:
    rows = [case((1, 0.01, 1.0), (2, 0.01, 2.0))] * 18 + [case((1, 0.2, 1.0), (2, 0.01, 2.0))] * 2
    name, share, seconds, auto = one_step(rows, 0.05)
    assert (name, share) == ("bdf2, dt / 2", 1.0)
    assert (seconds, auto) == (pytest.approx(40.0), pytest.approx(60.0))
    assert one_step(rows[:19], 0.05)[0] == "bdf2, dt / 2", "18 of 19 are fewer than 95 %"
    assert one_step([*rows[:19], *rows[:5]], 0.05)[0] == "bdf2, dt / 1", "23 of 24 are enough"


def test_a_ladder_that_ended_counts_as_kept_and_chaotic_cases_do_not_count() -> None:
    rows = [
        case((1, 0.005, 1.0)),
        case((1, 0.2, 1.0), (2, 0.1, 2.0), (4, 0.005, 4.0)),
        case(own=0.04),
        case(apart=0.06),
    ]
    name, share, seconds, auto = one_step(rows, 0.05)
    assert (name, share) == ("bdf2, dt / 4", 1.0)
    assert (seconds, auto) == (pytest.approx(8.0), pytest.approx(6.0)), "4 s each; thirds broke off"


def test_where_none_keeps_it_the_one_that_keeps_most_is_named() -> None:
    rows = [case((1, 0.01, 1.0))] * 3 + [case()]
    name, share, _, _ = one_step(rows, 0.05)
    assert (name, share) == ("bdf2, dt / 1", 0.75)
