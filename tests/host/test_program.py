"""What every program runs in: its streams, and failures of the machine in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names
from tripod_host.program import ENVIRONMENT, SINGLE

ROOT = Path(__file__).parents[2]
HEAD = "import sys\nfrom tripod_host.program import program\nwith program('it'):\n    "


def run(line: str, shell: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    """Run one line as a program, with the redirections of `shell`."""
    command = f'exec "{sys.executable}" -c "$0" {shell}'
    return subprocess.run(
        ["bash", "-c", command, HEAD + line],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environment},
    )


def test_a_closed_output_is_told_in_one_line() -> None:
    done = run("print('lost')", ">&-")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert_names(done.stderr, "it:", "standard output", "closed", "/dev/null")


def test_a_closed_input_is_an_empty_one() -> None:
    done = run("print(repr(sys.stdin.read()))", "<&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, "''\n", "")


def test_a_file_never_gets_what_is_printed(tmp_path: Path) -> None:
    done = run(f"f = open('{tmp_path}/f', 'w'); print('lost', file=sys.stderr); f.write('kept')", "<&- 2>&-")
    assert done.returncode == 0
    assert (tmp_path / "f").read_text() == "kept"


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_output_is_told_in_one_line(unbuffered: str) -> None:
    done = run("print('lost')", ">/dev/full", PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert_names(done.stderr, "it:", "standard output", "No space left")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_output_is_no_bad_argument_of_a_run(unbuffered: str) -> None:
    words = ["run", "pendulum", "--duration", "0.01"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "tripod_bringup", *words],
            cwd=ROOT,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert_names(done.stderr, "tripod:", "standard output", "No space left")


def test_a_reader_that_left_is_no_failure_to_tell() -> None:
    done = run("print('lost\\n' * 100_000)", "| head -n 1 >/dev/null; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("locale", [{"LC_ALL": "C"}, {"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "POSIX"}])
def test_every_name_can_be_printed(locale: dict[str, str]) -> None:
    done = run("print('\\udcff', '\\u2192')", **locale)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("failing", "named"),
    [
        ("open('/nowhere/at/all')", ("/nowhere/at/all", "No such file")),
        ("raise MemoryError", ("memory",)),
        ("import no_such_module", ("'no_such_module'",)),
        ("import os; [os.open('/', 0) for _ in range(10**9)]", (" /:", "open files")),
    ],
)
def test_what_the_machine_lacks_is_told_in_one_line(failing: str, named: tuple[str, ...]) -> None:
    done = run(failing)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert_names(done.stderr, "it:", *named)


def test_a_directory_that_is_gone_is_told_in_one_line(tmp_path: Path) -> None:
    line = f"cd {tmp_path} && mkdir gone && cd gone && rmdir ../gone"
    command = f'{line} && exec "{sys.executable}" -c "$0"'
    done = subprocess.run(
        ["bash", "-c", command, HEAD + "print('lost')"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert_names(done.stderr, "it:", "current directory", "No such file", "cd")


def test_one_thread_and_level_2_of_the_compiler_unless_the_environment_says_otherwise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for variable in ENVIRONMENT:
        monkeypatch.delenv(variable, raising=False)
    line = f"import os; print(*(os.environ[v] for v in {tuple(ENVIRONMENT)}))"
    assert run(line).stdout == "1 1 1 2\n"
    assert run(line, **{SINGLE[0]: "3"}).stdout == "3 1 1 2\n"
