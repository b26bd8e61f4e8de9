"""Which blocks of a parameter file are for a node, and which names several nodes share."""

import os
from pathlib import Path

import pytest

from tests.messages import assert_names, raises_naming
from tripod_graph.parameter_files import is_for, parameter_files, shared_names, strangers

TEXT = """
/**:
  ros__parameters: {common: 1, nested: {a: 2}}
left:
  driver:
    ros__parameters: {rate: 25.0}
"/*/sim":
  ros__parameters: {scene: tripod}
"""


@pytest.mark.parametrize(
    ("pattern", "node", "expected"),
    [
        ("/**", "/driver", True),
        ("/**", "/left/driver", True),
        ("/**/driver", "/driver", True),
        ("/**/driver", "/a/b/driver", True),
        ("/**/driver", "/a/b/driverx", False),
        ("/*/driver", "/left/driver", True),
        ("/*/driver", "/driver", False),
        ("/*", "/driver", True),
        ("/left/**", "/left/a/driver", True),
        ("/left/**", "/right/driver", False),
        ("driver", "/driver", True),
        ("driver", "/left/driver", False),
        ("/le.t/driver", "/left/driver", False),
    ],
)
def test_patterns(pattern: str, node: str, expected: bool) -> None:
    assert is_for(pattern, node) is expected


def test_names_in_blocks_for_several_nodes_are_shared(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(TEXT, encoding="utf-8")
    assert shared_names([file]) == {"common", "nested.a", "scene"}
    assert strangers([file], "/other") == []
    file.write_text(TEXT[TEXT.index("left") :], encoding="utf-8")
    assert strangers([file], "/left/driver") == []
    (warning,) = strangers([file], "/other")
    assert_names(warning, f"parameter file {file}", "nothing", "/other", "/left/driver, /*/sim")


@pytest.mark.parametrize("text", ["", "a: [", "- 1\n- 2", "7", "\x00"])
def test_a_file_that_is_none_shares_nothing(text: str, tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(text, encoding="utf-8")
    assert shared_names([file, tmp_path / "absent"]) == frozenset()
    assert strangers([file], "/driver") == []


def test_the_files_are_those_that_the_words_name(tmp_path: Path) -> None:
    files = [tmp_path / "a.yaml", tmp_path / "b.yaml"]
    words = ["--ros-args", "--params-file", str(files[0]), "-p", "x:=1", "--params-file", str(files[1])]
    with raises_naming(ValueError, f"parameter file {files[0]}", "No such file"):
        parameter_files(words)
    for file in files:
        file.touch()
    assert parameter_files(words) == files
    files[1].unlink()
    os.mkfifo(files[1])
    with raises_naming(ValueError, files[1]):
        parameter_files(words)
