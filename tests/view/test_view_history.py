import numpy as np
import pytest

from tripod_view.history import History
from tripod_view.rejects import Rejects


def test_a_history_keeps_its_span_at_its_period() -> None:
    history = History(2, span=1.0, period=0.1)
    for i in range(300):
        history.add(0.01 * i, (i, -i))
    ages, first, second = history.series(2.99)
    assert len(ages) == len(first) == len(second) == 10
    assert np.diff(ages) == pytest.approx(np.full(9, 0.1))
    assert ages[-1] == pytest.approx(-0.09)
    assert first.tolist() == [200 + 10 * i for i in range(10)]
    assert second.tolist() == [-v for v in first]


def test_old_rows_are_not_shown_even_if_nothing_new_came() -> None:
    history = History(1, span=1.0, period=0.1)
    history.add(0.0, (1.0,))
    assert [a.tolist() for a in history.series(0.5)] == [[-0.5], [1.0]]
    assert [a.size for a in history.series(5.0)] == [0, 0]


def test_an_empty_history_has_empty_series() -> None:
    assert [a.size for a in History(3).series(0.0)] == [0, 0, 0, 0]


def test_rejects_are_counted_with_the_newest_reason() -> None:
    rejects = Rejects()
    assert (rejects.total, rejects.last) == (0, "")
    rejects.note("sim/mesh", "no triangles")
    assert rejects.note("target_pose", ValueError("nan")) == "target_pose: nan"
    assert (rejects.total, rejects.last) == (2, "target_pose: nan")
