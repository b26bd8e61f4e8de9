"""A driver that runs for days keeps its size."""

import math

import pytest

from tests.decisions import said
from tests.driver.bench import TICK, Bench
from tests.memory import blocks_grown
from tripod_driver.protocol import WORKSHOP
from tripod_graph.mode import Mode


@pytest.mark.parametrize("protocol", ["framed", *WORKSHOP])
def test_what_was_sent_is_not_kept(protocol: str) -> None:
    bench = Bench(protocol=protocol)
    bench.safety.control_mode(said(Mode.TELEOP, bench.clock.now), bench.clock.now, bench.clock.now)

    def move(duration: float) -> None:
        for k in range(round(duration / TICK)):
            bench.clock.now += TICK
            if k % 4 == 0:
                bench.goto(*[-1.0 + 0.3 * math.sin(bench.clock.now + phase) for phase in range(3)], time=0.05)
            bench.driver.tick(bench.clock.now)

    assert blocks_grown(lambda: move(60.0), warm_up=lambda: move(90.0)) < 1000
    assert bench.driver.packets_sent > 4000
