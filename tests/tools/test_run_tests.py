"""`make test`: two halves at once, or one pytest with the user's arguments."""

from pathlib import Path

import pytest

from tools import run_tests


@pytest.fixture
def halves(tmp_path: Path) -> Path:
    """A directory with a test that passes and one that fails."""
    for name, outcome in (("one", "True"), ("two", "False")):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"test_{name}.py").write_text(f"def test_{name}():\n    assert {outcome}\n")
    return tmp_path


def test_both_halves_are_shown_one_after_the_other_and_a_failure_of_either_counts(
    halves: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for order in (["one", "two"], ["two", "one"]):
        assert run_tests.run_halves([["-q", name] for name in order], halves) == 1
        out, _ = capfd.readouterr()
        first, second = out.split(f"\npytest -q {order[1]}\n")
        assert "1 passed" in (first if order[0] == "one" else second)
        assert "1 failed" in (first if order[0] == "two" else second)
    assert run_tests.run_halves([["-q", "one"], ["-q", "one"]], halves) == 0


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
