"""Parameters on their way to a node."""

import pytest
import yaml

pytest.importorskip("rclpy")

from tests.messages import raises_naming
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
    with raises_naming(ValueSyntaxError, repr(word), "--set NAME=VALUE"):
        split_word(word)


def test_text_parameters_take_numbers_as_text_and_numbers_stay_yaml() -> None:
    values = parse_values(["port:=2024", "rate:=25", "park:=[0, 1]"], TABLE, "driver")
    assert node_arguments(values) == ['port:="2024"', "rate:=25", "park:=[0, 1]"]
    assert node_arguments({"port": typed("'quoted'", str)}) == ["port:='quoted'"]


def test_an_unknown_parameter_is_refused_with_the_one_that_is_meant() -> None:
    with raises_naming(UnknownParameterError, "'prot'", "'port'", *(parameter.name for parameter in TABLE)):
        parse_values(["prot:=mock"], TABLE, "driver")


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("rate:=51", ("'rate'", "51.0", "1 to 50 Hz")),
        ("rate:=fast", ("'rate'", "'fast'", "type float")),
        ("rate:=", ("'rate'", "None", "type float")),
        ("count:=1.5", ("'count'", "1.5", "type int")),
        ("count:=-1", ("'count'", "-1", "at least 0")),
        ("parks:=maybe", ("'parks'", "'maybe'", "type bool")),
        ("mode:=warp", ("'mode'", "'warp'", "slow, fast")),
        ("park:=0.5", ("'park'", "0.5", "list of numbers")),
        ("park:={a: 1}", ("'park'", "{'a': 1}", "list of numbers")),
    ],
)
def test_a_value_that_cannot_be_is_refused_before_the_node_starts(word: str, named: tuple[str, ...]) -> None:
    with raises_naming(ParameterError, *named):
        parse_values([word], TABLE, "driver")


@pytest.mark.parametrize("word", ["park:=[0, 1", "park:={[]: 1}"])
def test_what_is_not_yaml_is_refused(word: str) -> None:
    with raises_naming(ValueSyntaxError, word.partition(":=")[2], "YAML", "quote"):
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
    ("word", "named"),
    [
        ("port:=mock", ("'port:=mock'", "--set NODE.NAME=VALUE")),
        ("driver.:=mock", ("'driver.:=mock'", "--set NODE.NAME=VALUE")),
        ("drvier.port:=mock", ("'drvier'", "'driver'")),
        ("driver.port", ("'driver.port'", "--set NAME=VALUE")),
        ("driver.angle_mx:=3", ("driver", "'angle_mx'", "'angle_max'")),
        ("driver.angle_max:=9", ("driver", "'angle_max'", "9.0", "-3.2 to 3.2 rad")),
        ("sim.body_rate:=often", ("sim", "'body_rate'", "'often'", "type float")),
    ],
)
def test_parameters_of_up_that_no_node_takes_are_refused(word: str, named: tuple[str, ...]) -> None:
    with raises_naming(ValueError, *named):
        node_values([word])


def test_parameters_of_up_that_would_change_nothing_are_refused() -> None:
    check_used(node_values(["record.max_size:=5", "view.port:=1"]), record=True, view=True)
    for word, named in (
        ("record.max_size:=5", ("record.max_size", "not run", "--record DIR")),
        ("view.port:=8081", ("view.port", "not run", "--no-view")),
        ("sim.scene:=maze", ("sim.scene", "first word", "tripod up maze")),
    ):
        with raises_naming(ValueError, *named):
            check_used(node_values([word]), record=False, view=False)


def test_what_an_option_and_a_parameter_say_is_said_once() -> None:
    values = node_values(["driver.port:=/dev/ttyUSB0", "record.max_size:=5"])
    check_once(values, {"--port": None, "--view-port": 9000, "--record": "here"})
    with raises_naming(ValueError, "--set driver.port=/dev/ttyUSB0", "--port auto"):
        check_once(values, {"--port": "auto"})
