"""The parameter table: defaults, conversions, and refusals that name parameter, value and what is allowed."""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("rclpy")

from tests.messages import assert_names, raises_naming
from tripod_graph.parameters import Parameter, ParameterError, declare

TABLE = (
    Parameter("rate", 50.0, "Packets a second", "Hz", low=1.0, high=50.0, dynamic=True),
    Parameter("count", 3, "A number of things", low=0),
    Parameter("gain", 1.0, "Any gain", high=9.0),
    Parameter("offset", 0.0, "Any offset"),
    Parameter("mode", "slow", "How", choices=("slow", "fast")),
    Parameter("joints", [0.0, 0.0], "Angles", "rad", low=-1.0, high=1.0, dynamic=True),
    Parameter("start", [], "Angles, if known", "rad", low=-1.0, high=1.0),
    Parameter("enabled", True, "Whether"),
)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("rate", 51.0, "1 to 50 Hz"),
        ("rate", math.nan, "1 to 50 Hz"),
        ("rate", True, "1 to 50 Hz"),
        ("count", -1, "at least 0"),
        ("gain", 10.0, "at most 9"),
        ("offset", math.nan, "any number"),
        ("mode", "warp", "one of slow, fast"),
        ("joints", [0.0, 1.5], "-1 to 1 rad"),
        ("joints", [math.nan, 0.0], "-1 to 1 rad"),
    ],
)
def test_value_out_of_range_is_refused_with_what_is_allowed(name: str, value: object, allowed: str) -> None:
    parameter = next(p for p in TABLE if p.name == name)
    with raises_naming(ParameterError, f"parameter '{name}'", repr(value), allowed):
        parameter.check(value)


@pytest.mark.parametrize("value", [1.0, 50.0, 7])
def test_value_within_the_range_passes(value: float) -> None:
    TABLE[0].check(value)


@contextmanager
def node_with(domain: int, overrides: dict[str, object]) -> Iterator[Any]:
    import rclpy
    from rclpy.node import Node
    from rclpy.parameter import Parameter as RosParameter

    context = rclpy.Context()
    context.init(domain_id=domain)
    node = None
    try:
        given = [RosParameter(name, value=value) for name, value in overrides.items()]
        node = Node("declares", context=context, parameter_overrides=given, enable_rosout=False)
        yield node
    finally:
        if node is not None:
            node.destroy_node()
        context.try_shutdown()


def declared(domain: int, overrides: dict[str, object]) -> dict[str, object]:
    with node_with(domain, overrides) as node:
        return declare(node, TABLE)


@pytest.mark.ros
def test_declare_returns_defaults_and_takes_integers_for_floats(domain: int) -> None:
    defaults = {p.name: p.default for p in TABLE}
    assert declared(domain, {}) == defaults
    given = {"rate": 20, "joints": [1, 0], "mode": "fast", "start": [1, -1], "gain": -math.inf}
    values = declared(domain, given)
    changed = {**given, "rate": 20.0, "joints": [1.0, 0.0], "start": [1.0, -1.0]}
    assert values == {**defaults, **changed}
    assert type(values["rate"]) is float
    assert type(values["count"]) is int


@pytest.mark.ros
@pytest.mark.parametrize(
    ("overrides", "named"),
    [
        ({"speed": 1.0}, ("'speed'", "count, enabled, gain", "joints, mode, offset")),
        (
            {"qos_overrides./sim/mesh.publisher.depth": 5},
            ("'qos_overrides./sim/mesh.publisher.depth'", "quality of service"),
        ),
        ({"rate": "quick"}, ("'rate'", "'quick'", "float")),
        ({"count": 1.5}, ("'count'", 1.5, "int")),
        ({"enabled": 1}, ("'enabled'", 1, "bool")),
        ({"start": ["a"]}, ("'start'", "['a']", "list of numbers")),
        ({"joints": ["a"]}, ("'joints'", "['a']", "list of numbers")),
        ({"rate": 100}, ("'rate'", 100.0, "1 to 50 Hz")),
    ],
)
def test_declare_refuses_by_name(
    domain: int, overrides: dict[str, object], named: tuple[object, ...]
) -> None:
    with raises_naming(ParameterError, *named):
        declared(domain, overrides)


@pytest.mark.ros
def test_dynamic_parameters_change_together_or_not_at_all(domain: int) -> None:
    from rclpy.parameter import Parameter as RosParameter

    adopted: list[Mapping[str, Any]] = []

    def adopt(values: Mapping[str, Any]) -> None:
        if values["rate"] == 13.0:
            raise ValueError("rate is 13 Hz")
        adopted.append(values)

    with node_with(domain, {"count": 4}) as node:
        first = declare(node, TABLE, adopt)

        def change(**values: object) -> tuple[bool, str]:
            result = node.set_parameters_atomically([RosParameter(k, value=v) for k, v in values.items()])
            return result.successful, result.reason

        for values, named in (
            ({"count": 5}, ("read-only", "count")),
            ({"rate": 10.0, "mode": "fast"}, ("read-only", "mode")),
            ({"rate": 51.0}, ("rate", 1.0, 50.0, 51.0)),
            ({"rate": 20}, ("Type.DOUBLE", "Type.INTEGER")),
            ({"rate": 10.0, "joints": [0.0, 1.5]}, ("'joints'", "[0.0, 1.5]", "-1 to 1 rad")),
            ({"rate": 13.0}, ("rate", "13 Hz")),
        ):
            successful, reason = change(**values)
            assert not successful
            assert_names(reason, *named)
            assert node.get_parameter("rate").value == 50.0
        assert adopted == []
        assert change(rate=10.0) == (True, "")
        assert change(joints=[0.5, -0.5]) == (True, "")
        assert change(use_sim_time=False) == (True, "")  # which is not of the table
        assert adopted == [{**first, "rate": 10.0}, {**first, "rate": 10.0, "joints": [0.5, -0.5]}]
        assert type(adopted[1]["joints"]) is list
        told = {p.name: node.describe_parameter(p.name).read_only for p in TABLE}
        assert told == {p.name: p.name not in ("rate", "joints") for p in TABLE}


@pytest.mark.ros
def test_a_period_changes_at_once_and_wakes_no_timer_that_is_cancelled(domain: int) -> None:
    from tripod_graph.timers import set_period

    with node_with(domain, {}) as node:
        timer = node.create_timer(1000.0, lambda: None)
        set_period(timer, 2.0)
        assert 0 < timer.time_until_next_call() <= 2e9
        timer.cancel()
        set_period(timer, 3.0)
        assert timer.is_canceled()
        assert timer.timer_period_ns == 3e9
