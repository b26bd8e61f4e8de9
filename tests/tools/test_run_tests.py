"""`make test`: pytests that share all tests, or one with the user's arguments."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tools import run_tests

GOOD, BAD = ["--version"], ["--no-such-option"]
"""What needs no tests to end well and badly."""


@pytest.mark.parametrize(("orders", "code"), [([GOOD, GOOD], 0), ([GOOD, BAD], 4), ([BAD, GOOD], 4)])
def test_both_are_shown_one_after_the_other_and_a_failure_of_either_counts(
    capfd: pytest.CaptureFixture[str], orders: list[list[str]], code: int
) -> None:
    assert run_tests.run_shared([run_tests.Share(order) for order in orders]) == code
    out, errors = capfd.readouterr()
    first, second = out.split("\npytest 2 of 2\n")
    first += errors  # only that of the others is kept with their output
    for said, words in ((first, orders[0]), (second, orders[1])):
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
    shares = [run_tests.Share(["test_good.py"]), run_tests.Share(["test_other.py"], nice=1)]
    assert run_tests.run_shared(shares, tmp_path) == code
    out, _ = capfd.readouterr()
    name = "test_second_time" if code == 0 else "test_never"
    assert f"once more without them:\n  test_other.py::{name}\n" in out
    assert out.count("1 passed") == 2 - code  # what was good is not run again


@pytest.mark.parametrize(
    ("words", "processors", "expected"),
    [
        ([], 2, run_tests.shares(2)),
        ([], 64, run_tests.shares(run_tests.MOST)),
        ([], 1, [run_tests.Share([])]),
        (["-x", "tests/ik"], 4, [run_tests.Share(["-x", "tests/ik"])]),
    ],
)
def test_arguments_and_a_single_processor_mean_one_pytest(
    monkeypatch: pytest.MonkeyPatch, words: list[str], processors: int, expected: object
) -> None:
    monkeypatch.setattr(run_tests.os, "sched_getaffinity", lambda _: set(range(processors)))
    monkeypatch.setattr(run_tests, "run_shared", lambda given: given)
    assert run_tests.main(words) == expected


COUNTED = """
import pytest

@pytest.fixture(scope="module")
def one():
    with open({log!r}, "a") as file:
        file.write("made {name}\\n")
    yield
    with open({log!r}, "a") as file:
        file.write("ended {name}\\n")

@pytest.mark.parametrize("k", range(3))
def test_it(one, k):
    with open({log!r}, "a") as file:
        file.write(f"{name} {{k}}\\n")
    assert {name!r} != "c" or k != 1
"""


def test_each_file_is_run_once_by_one_of_those_who_share_it(tmp_path: Path) -> None:
    """Fixtures of a file are made and ended once; a failure ends the one that met it with its code, not the others."""
    log, taken = tmp_path / "log", tmp_path / "taken"
    (tmp_path / "conftest.py").write_text(
        "from tools.shared_tests import pytest_collection, pytest_runtestloop\n"
    )
    for name in "abcd":
        (tmp_path / f"test_{name}.py").write_text(COUNTED.format(log=str(log), name=name))
    taken.mkdir()
    (taken / "test_b.py").touch()  # another has it
    environment = {**os.environ, "PYTHONPATH": str(run_tests.ROOT), run_tests.TAKEN: str(taken)}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    codes = [
        subprocess.run(
            [*words, *order], check=False, cwd=tmp_path, env=environment, capture_output=True
        ).returncode
        for order in (
            ["test_c.py", "test_b.py", "test_a.py"],
            ["test_a.py", "test_b.py", "test_c.py", "test_d.py"],
        )
    ]
    assert codes == [1, 0]
    expected = [f"{name} {k}" for name in "cad" for k in range(3)]
    for place, name in ((0, "c"), (5, "a"), (10, "d")):
        expected.insert(place, f"made {name}")
        expected.insert(place + 4, f"ended {name}")
    assert log.read_text().splitlines() == expected


SHARING = """
import pytest
from tools.shared_tests import pytest_collection, pytest_runtestloop

@pytest.fixture
def of_the_folder():
    return 1
"""


def test_what_another_has_taken_is_not_imported_and_a_file_that_cannot_be_counts(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "conftest.py").write_text(SHARING)
    (tmp_path / "sub" / "conftest.py").write_text(SHARING.replace("folder", "subfolder"))
    (tmp_path / "sub" / "test_a.py").write_text("raise ValueError\n")
    for name in "bc":
        text = f"def test_{name}(of_the_folder, of_the_subfolder):\n    pass\n"
        (tmp_path / "sub" / f"test_{name}.py").write_text(text)
    files = [f"sub/test_{name}.py" for name in "abc"]
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *files]

    def run(*others: str) -> tuple[int, bool]:
        taken = tmp_path / "-".join(["taken", *others])
        taken.mkdir()
        for name in others:
            (taken / f"sub+test_{name}.py").touch()
        environment = {**os.environ, "PYTHONPATH": str(run_tests.ROOT), run_tests.TAKEN: str(taken)}
        done = subprocess.run(
            words, check=False, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        return done.returncode, "2 passed" in done.stdout

    assert run() == (1, True)
    assert run("a") == (0, True)
    assert run("a", "b", "c") == (0, False)


@pytest.mark.parametrize("processors", [2, 4])
def test_the_shares_hold_every_file_of_tests_once(processors: int) -> None:
    files = {
        str(path.relative_to(run_tests.ROOT)) for path in (run_tests.ROOT / "tests").glob("**/test_*.py")
    }
    *computing, waiting, left_over = run_tests.shares(processors)
    assert len(computing) == processors - 1
    for share in (*computing, waiting):
        assert len(share.words) == len(files)
        assert set(share.words) == files
        assert share.nice == 0
    assert computing[0].words[: len(run_tests.LONGEST)] == list(run_tests.LONGEST)
    assert waiting.words[0].startswith("tests/bringup/")
    assert left_over.nice > 0
    assert left_over.words[-1] == next(f for f in run_tests.LONGEST if f in left_over.words)
    assert set(left_over.words) < files
    assert "tests/sim/test_contact_solid.py" in left_over.words
    for file in (
        "sim/test_sim_node.py",
        "sim/test_realtime.py",
        "ik/test_ik_node.py",
        "bringup/test_signals.py",
    ):
        assert f"tests/{file}" not in left_over.words


@pytest.mark.parametrize("given", [{}, {"PYTHONDONTWRITEBYTECODE": "1"}])
def test_what_python_compiles_is_kept_for_the_processes_that_tests_start(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: dict[str, str]
) -> None:
    """In a directory of the tests where the user wants none beside the sources."""
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)
    monkeypatch.delenv("PYTHONPYCACHEPREFIX", raising=False)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "module.py").write_text("")
    environment = run_tests.environment_of(tmp_path)
    subprocess.run([sys.executable, "-c", "import module"], cwd=tmp_path, env=environment, check=True)
    (found,) = tmp_path.glob("**/module.*.pyc")
    assert (tmp_path / "bytecode" in found.parents) == bool(given)


def test_the_environment_is_that_of_programs_unless_the_user_says_more(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in run_tests.ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    assert run_tests.environment_of(tmp_path).items() >= run_tests.ENVIRONMENT.items()
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert run_tests.environment_of(tmp_path)["OMP_NUM_THREADS"] == "3"
