"""`make test`: two halves at once, or one pytest with the user's arguments."""

from pathlib import Path

import pytest

from tools import run_tests

GOOD, BAD = ["--version"], ["--no-such-option"]
"""What needs no tests to end well and badly."""


@pytest.mark.parametrize(("halves", "code"), [([GOOD, GOOD], 0), ([GOOD, BAD], 4), ([BAD, GOOD], 4)])
def test_both_halves_are_shown_one_after_the_other_and_a_failure_of_either_counts(
    capfd: pytest.CaptureFixture[str], halves: list[list[str]], code: int
) -> None:
    assert run_tests.run_halves(halves) == code
    out, errors = capfd.readouterr()
    first, second = out.split(f"\npytest {halves[1][0]}\n")
    first += errors  # only that of the others is kept with their output
    for said, words in ((first, halves[0]), (second, halves[1])):
        assert f"pytest {pytest.__version__}" in said if words is GOOD else "unrecognized arguments" in said


SECOND_TIME = """
def test_second_time():
    mark = {mark!r}
    try:
        open(mark, "x")
    except FileExistsError:
        return
    assert False
"""
NEVER = "def test_never():\n    assert False\n"


@pytest.mark.parametrize(("body", "code"), [(SECOND_TIME, 0), (NEVER, 1)])
def test_what_failed_beside_others_runs_once_more_and_counts_if_it_fails_again(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, body: str, code: int
) -> None:
    (tmp_path / "test_good.py").write_text("def test_good():\n    pass\n")
    (tmp_path / "test_other.py").write_text(body.format(mark=str(tmp_path / "mark")))
    halves = [["test_good.py"], ["test_other.py"]]
    assert run_tests.run_halves(halves, tmp_path) == code
    out, _ = capfd.readouterr()
    name = "test_second_time" if code == 0 else "test_never"
    assert f"once more without it:\n  test_other.py::{name}\n" in out
    assert out.count("1 passed") == 2 - code  # what was good is not run again


@pytest.mark.parametrize(
    ("words", "processors", "expected"),
    [([], 2, run_tests.HALVES), ([], 1, [[]]), (["-x", "tests/ik"], 4, [["-x", "tests/ik"]])],
)
def test_arguments_and_a_single_processor_mean_one_pytest(
    monkeypatch: pytest.MonkeyPatch, words: list[str], processors: int, expected: object
) -> None:
    monkeypatch.setattr(run_tests.os, "sched_getaffinity", lambda _: set(range(processors)))
    monkeypatch.setattr(run_tests, "run_halves", lambda given: given)
    assert run_tests.main(words) == expected


def test_the_halves_hold_every_directory_of_tests() -> None:
    (sim,), (rest, without) = run_tests.HALVES
    assert (rest, without) == ("tests", f"--ignore={sim}")
    assert (run_tests.ROOT / sim).is_dir()
