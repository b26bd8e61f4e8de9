"""Tests name what messages say instead of quoting sentences."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.messages import LONGEST_PHRASE, assert_names, line_naming, names, prose_words, raises_naming

MESSAGE = "scene.toml: mesh.level is 12; allowed:\n  1 to 10. List the scenes: `tripod scenes`"


def test_a_message_names_fields_values_and_remedies_in_any_order() -> None:
    assert_names(MESSAGE, "tripod scenes", "mesh.level", 12, "1 to 10", "allowed: 1")
    assert_names(ValueError(MESSAGE), "Mesh.Level")


@pytest.mark.parametrize("absent", ["mesh.lev", 2, 1.5, "level is 1", "scene.tom"])
def test_a_part_of_a_name_or_value_does_not_count(absent: object) -> None:
    assert not names(MESSAGE, absent)
    with pytest.raises(AssertionError, match="not named"):
        assert_names(MESSAGE, "mesh.level", absent)


def test_a_value_that_goes_on_behind_the_point_is_another() -> None:
    assert not names("it is 2.5 or 0.2", 2)
    assert names("it is 2.", 2)


@pytest.mark.parametrize("what", [(), ("",), ("the level of the mesh is",)])
def test_what_would_pass_always_or_quotes_a_sentence_is_refused(what: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="name"):
        names(MESSAGE, *what)


def test_colours_and_modes_of_a_terminal_are_no_text() -> None:
    assert_names("\x1b[?2004lended by \x1b[1mq\x1b[0m", "ended by q")


def test_an_exception_is_checked_by_what_it_names() -> None:
    with raises_naming(ValueError, "mesh.level", 12) as caught:
        raise ValueError(MESSAGE)
    assert str(caught.value) == MESSAGE
    with pytest.raises(AssertionError), raises_naming(ValueError, "mesh.element"):
        raise ValueError(MESSAGE)


def test_one_line_is_found_by_what_it_names() -> None:
    assert line_naming(MESSAGE, "tripod scenes").startswith("  1 to 10")
    with pytest.raises(AssertionError, match="0 lines"):
        line_naming(MESSAGE, "mesh.level", "tripod scenes")


@pytest.mark.parametrize(
    ("text", "count"),
    [("the level of the mesh", 5), ("mesh.level is 12", 1), ("sudo apt-get install a b c d e", 0), ("", 0)],
)
def test_words_of_prose_are_letters_only(text: str, count: int) -> None:
    assert prose_words(text) == count


def quoted_sentences(path: Path) -> Iterator[str]:
    """Yield where a test quotes a sentence: in an `assert`, or as `match` of an expected exception."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        checked: list[ast.AST] = [node.test] if isinstance(node, ast.Assert) else []
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("raises", "warns")):
            checked = [keyword.value for keyword in node.keywords if keyword.arg == "match"]
        for part in (text for place in checked for text in ast.walk(place)):
            text = part.value if isinstance(part, ast.Constant) else None
            if isinstance(text, str) and prose_words(text) > LONGEST_PHRASE:
                yield f"{path}:{part.lineno}: {text!r}"


def test_no_test_quotes_a_sentence() -> None:
    files = sorted(Path(__file__).parent.rglob("*.py"))
    found = [place for path in files for place in quoted_sentences(path)]
    assert len(files) > 200
    assert not found, "\n".join(["see tests/messages.py", *found])
