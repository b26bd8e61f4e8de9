"""Parameters on their way to a node."""

from dataclasses import dataclass

import pytest
import yaml

from tripod_bringup.node_command import UnknownParameterError, parse_values
from tripod_bringup.node_values import RawYaml, ValueSyntaxError, node_arguments, split_word, typed
from tripod_bringup.up_command import node_values


@dataclass
class Row:
    """What `parse_values` reads of a parameter."""

    name: str
    default: object


TABLE = [Row("port", "auto"), Row("rate", 50.0), Row("park", [0.0, 0.0])]


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
    values = parse_values(["port:=2024", "rate:=25", "park:=[0, 1]"], TABLE, "driver")  # type: ignore[arg-type]
    assert node_arguments(values) == ['port:="2024"', "rate:=25", "park:=[0, 1]"]
    assert node_arguments({"port": typed("'quoted'", str)}) == ["port:='quoted'"]


def test_an_unknown_parameter_is_refused_with_the_one_that_is_meant() -> None:
    with pytest.raises(UnknownParameterError, match=r"'prot'; did you mean 'port'\? known: park, port, rate"):
        parse_values(["prot:=mock"], TABLE, "driver")  # type: ignore[arg-type]


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
    ],
)
def test_parameters_of_up_without_a_known_node_are_refused(word: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        node_values([word])
