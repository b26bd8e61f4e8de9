"""The last half minute again: what is kept, what of it is shown when."""

import numpy as np
import pytest

from tripod_view import replay as module
from tripod_view.replay import SPAN, Moment, Replay


def kept(seconds: float, nodes: int = 3) -> Replay:
    replay = Replay()
    for k in range(round(10 * seconds) + 1):
        replay.keep(Moment(0.1 * k, np.full((nodes, 3), k, np.float32), None, None, None))
    return replay


def test_only_the_last_half_minute_is_kept() -> None:
    assert kept(10).length() == pytest.approx(10)
    assert kept(50).length() == pytest.approx(SPAN, abs=0.11)
    assert Replay().length() == 0


def test_large_bodies_are_kept_for_less_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_BYTES", 50 * 12 * 3)
    assert kept(10).length() == pytest.approx(4.9)


def test_the_past_stands_still_or_goes_on_until_it_is_the_present() -> None:
    replay = kept(10)
    assert replay.moment(100.0) is None
    replay.show(4.0, False, 100.0)
    moment, age = replay.moment(107.0)
    assert (moment.time, age) == (pytest.approx(6.0), 4.0)
    replay.keep(Moment(11.0, np.zeros((3, 3), np.float32), None, None, None))
    assert replay.length() == pytest.approx(10), "nothing moves on while somebody looks at it"
    replay.show(4.0, True, 200.0)
    moment, age = replay.moment(203.0)
    assert (moment.time, age) == (pytest.approx(9.0), pytest.approx(1.0))
    assert replay.moment(204.1) is None
    assert not replay.active
    replay.show(99.0, False, 300.0)
    assert replay.moment(300.0)[1] == pytest.approx(10)
    replay.show(None, False, 300.0)
    assert not replay.active


def test_another_body_has_another_past() -> None:
    replay = kept(10)
    replay.keep(Moment(10.1, np.zeros((5, 3), np.float32), None, None, None))
    assert replay.length() == 0
