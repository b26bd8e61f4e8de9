"""Words of the command line become ROS arguments, or are refused; ROS would ignore them silently."""

import pytest

from tests.messages import raises_naming
from tripod_graph.run import ros_arguments


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], []),
        (["port:=mock"], ["--ros-args", "-p", "port:=mock"]),
        (["a:=1", "b:=x:=y"], ["--ros-args", "-p", "a:=1", "-p", "b:=x:=y"]),
        (["park:=[0,-0.5, 1]"], ["--ros-args", "-p", "park:=[0.0, -0.5, 1.0]"]),
        (["n:=[1,2]"], ["--ros-args", "-p", "n:=[1,2]"]),
        (["names:=[a,0.5]"], ["--ros-args", "-p", "names:=[a,0.5]"]),
        (["__ns:=/left", "a:=1"], ["--ros-args", "-r", "__ns:=/left", "-p", "a:=1"]),
        (["a:=1", "--ros-args", "-r", "x:=y"], ["--ros-args", "-p", "a:=1", "-r", "x:=y"]),
        (["--ros-args", "--log-level", "debug"], ["--ros-args", "--log-level", "debug"]),
    ],
)
def test_words_become_ros_arguments(words: list[str], expected: list[str]) -> None:
    assert ros_arguments(words) == expected


@pytest.mark.parametrize("word", ["port=mock", "mock", "--port", ":=mock"])
def test_a_word_that_ros_would_ignore_is_refused(word: str) -> None:
    with raises_naming(ValueError, f"argument '{word}'", "NAME:=VALUE"):
        ros_arguments(["a:=1", word])
