"""Parameters on their way to a node."""

import re

import pytest
import yaml

pytest.importorskip("rclpy")

from tripod_bringup.node_command import UnknownParameterError, parse_values
from tripod_bringup.node_values import RawYaml, ValueSyntaxError, node_arguments, split_word, typed
from tripod_bringup.up_command import check_once, check_used, node_values
from tripod_graph.parameters import Parameter, ParameterError

TABLE = [
    Parameter("port", "auto", "A port"),
    Parameter("rate", 50.0, "A rate", "Hz", low=1.0, high=50.0),
    Parameter("park", [0.0, 0.0], "Angles"),
    Parameter("start", [], "Angles"),
    Parameter("count", 3, "How many", low=0),
    Parameter("parks", True, "Whether"),
    Parameter("mode", "slow", "How", choices=("slow", "fast")),
]


@pytest.mark.parametrize(
    "value", ["tripod", "2024", "true", "", 'a "b" \\ c: {é}', 8080, 0.5, True, [1.0, 2.5]]
)
def test_a_value_arrives_as_it_was_given(value: object) -> None:
    name, text = split_word(node_arguments({"x": value})[0])
    assert name == "x"
    assert yaml.safe_load(text) == value and type(yaml.safe_load(text)) is type(value)


@pytest.mark.parametrize("word", ["port", ":=5", "port=5"])
def test_a_word_that_sets_nothing_is_refused(word: str) -> None:
    with pytest.raises(ValueSyntaxError, match="write NAME:=VALUE"):
        split_word(word)


def test_text_parameters_take_numbers_as_text_and_numbers_stay_yaml() -> None:
    values = parse_values(["port:=2024", "rate:=25", "park:=[0, 1]"], TABLE, "driver")
    assert node_arguments(values) == ['port:="2024"', "rate:=25", "park:=[0, 1]"]
    assert node_arguments({"port": typed("'quoted'", str)}) == ["port:='quoted'"]


def test_an_unknown_parameter_is_refused_with_the_one_that_is_meant() -> None:
    with pytest.raises(
        UnknownParameterError,
        match=r"'prot'; did you mean 'port'\? known: count, mode, park, parks, port, rate, start",
    ):
        parse_values(["prot:=mock"], TABLE, "driver")


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("rate:=51", "parameter 'rate' is 51.0; allowed: 1 to 50 Hz"),
        ("rate:=fast", "parameter 'rate' is 'fast'; it must be of type float"),
        ("rate:=", "parameter 'rate' is None; it must be of type float"),
        ("count:=1.5", "parameter 'count' is 1.5; it must be of type int"),
        ("count:=-1", "parameter 'count' is -1; allowed: at least 0"),
        ("parks:=maybe", "parameter 'parks' is 'maybe'; it must be of type bool"),
        ("mode:=warp", "parameter 'mode' is 'warp'; allowed: one of slow, fast"),
        ("park:=0.5", "parameter 'park' is 0.5; it must be of type list of numbers"),
        ("park:={a: 1}", "parameter 'park' is {'a': 1}; it must be of type list of numbers"),
    ],
)
def test_a_value_that_cannot_be_is_refused_before_the_node_starts(word: str, message: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(message) + "$"):
        parse_values([word], TABLE, "driver")


@pytest.mark.parametrize("word", ["park:=[0, 1", "park:={[]: 1}"])
def test_what_is_not_yaml_is_refused(word: str) -> None:
    with pytest.raises(ValueSyntaxError, match="is not YAML; quote it"):
        parse_values([word], TABLE, "driver")


@pytest.mark.parametrize(
    "word",
    [
        "rate:=1e1",
        "rate:=0x10",
        "rate:=25",
        "parks:=y",
        "parks:=off",
        "start:=",
        "start:=[]",
        "start:=[0, 1e-3]",
    ],
)
def test_what_ros_reads_as_a_value_passes_as_it_is_written(word: str) -> None:
    assert node_arguments(parse_values([word], TABLE, "driver")) == [word]


def test_remapping_passes() -> None:
    assert parse_values(["__ns:=/left"], TABLE, "driver") == {"__ns": "/left"}  # type: ignore[arg-type]


def test_parameters_of_up_name_their_node() -> None:
    values = node_values(["driver.rate:=25", "view.port:=8081", "driver.port:=mock"])
    assert values == {"driver": {"rate": "25", "port": "mock"}, "view": {"port": "8081"}}
    assert isinstance(values["driver"]["rate"], RawYaml)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("port:=mock", "names no node"),
        ("driver.:=mock", "names no node"),
        ("drvier.port:=mock", "did you mean 'driver'"),
        ("driver.port", "write NAME:=VALUE"),
        ("driver.angle_mx:=3", "no parameter of driver is named 'angle_mx'; did you mean 'angle_max'?"),
        ("driver.angle_max:=9", "driver: parameter 'angle_max' is 9.0; allowed: -3.2 to 3.2 rad"),
        ("sim.body_rate:=often", "sim: parameter 'body_rate' is 'often'; it must be of type float"),
    ],
)
def test_parameters_of_up_that_no_node_takes_are_refused(word: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        node_values([word])


def test_parameters_of_up_that_would_change_nothing_are_refused() -> None:
    check_used(node_values(["record.max_size:=5", "view.port:=1"]), record=True, view=True)
    for word, message in (
        ("record.max_size:=5", "record.max_size: record does not run; add --record DIR"),
        ("view.port:=8081", "view.port: view does not run; leave out --no-view"),
        ("sim.scene:=maze", "name the scene by the first word"),
    ):
        with pytest.raises(ValueError, match=message):
            check_used(node_values([word]), record=False, view=False)


def test_what_an_option_and_a_parameter_say_is_said_once() -> None:
    values = node_values(["driver.port:=/dev/ttyUSB0", "record.max_size:=5"])
    check_once(values, {"--port": None, "--view-port": 9000, "--record": "here"})
    said = re.escape("driver.port:=/dev/ttyUSB0 and --port auto say the same; leave one out")
    with pytest.raises(ValueError, match=said):
        check_once(values, {"--port": "auto"})
