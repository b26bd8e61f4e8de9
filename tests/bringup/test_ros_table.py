"""What ros_table.md says a person sees in a sourced ROS, with the real `ros2`, where colcon has built the suite."""

import os
import pty
import re
import select
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.domains import own_domain

PAGE = (Path(__file__).parents[2] / "docs" / "ros.md").read_text(encoding="utf-8")
TABLE = (Path(__file__).parent / "ros_table.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (`ros2 .*?`|the goal above.*?) \| (.*) \|$", TABLE, re.MULTILINE)
DEADLINE = 120.0  # [s], for a loaded machine


def built() -> bool:
    """Whether `ros2` is there, and knows the package."""
    words = ["ros2", "pkg", "prefix", "tripod"]
    return (
        bool(shutil.which("ros2")) and not subprocess.run(words, capture_output=True, check=False).returncode
    )


pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(not built(), reason="no `ros2` that knows tripod: see docs/ros.md"),
]


class Terminal:
    """A command in a terminal of its own.

    Attributes:
        said: What it has printed.
    """

    def __init__(self, command: str, environment: dict[str, str]) -> None:
        self.said = ""
        self._process, self._screen = pty.fork()
        if self._process == 0:
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.execvpe("sh", ["sh", "-c", f"exec {command}"], environment)
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        while select.select([self._screen], [], [], DEADLINE)[0]:
            try:
                self.said += os.read(self._screen, 65536).decode(errors="replace")
            except OSError:  # it has ended
                return

    def wait(self, text: str) -> None:
        end = time.monotonic() + DEADLINE
        while text not in self.said:
            assert time.monotonic() < end, f"no {text!r} in {self.said}"
            time.sleep(0.1)

    def interrupt(self) -> int:
        """Type Ctrl-C; return the exit code."""
        os.write(self._screen, b"\x03")
        code = os.waitstatus_to_exitcode(os.waitpid(self._process, 0)[1])
        self._reader.join(DEADLINE)
        return code


def expected(cell: str) -> list[str]:
    """Return what a cell of the table says is printed."""
    return re.findall(r"`(.*?)`", cell) or cell.split(", ")


@pytest.fixture(scope="module")
def environment() -> Iterator[dict[str, str]]:
    """One of the tests' own, with a launched suite in it; what the launch says at its end is checked there."""
    (launch, cell) = next(row for row in ROWS if "ros2 launch" in row[0])
    started, ended, times = re.fullmatch(r"`(.*?)`; Ctrl-C: `(.*?)` (three) times", cell).groups()  # type: ignore[union-attr]
    with own_domain() as domain:
        variables = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        given = {**os.environ, **variables}
        suite = Terminal(launch.strip("`"), given)
        suite.wait(started)
        yield given
        assert suite.interrupt() == 0
        assert (times, suite.said.count(ended)) == ("three", 3), suite.said


@pytest.mark.parametrize(("words", "cell"), [row for row in ROWS if "ros2 launch" not in row[0]])
def test_the_table_is_what_ros2_prints(environment: dict[str, str], words: str, cell: str) -> None:
    command = words.strip("`")
    if command.startswith("the goal above"):
        block = re.search(r"^(ros2 action send_goal .*?}}\")$", PAGE, re.MULTILINE | re.DOTALL)
        assert block
        command = block[1].replace(" /robot/", " /left/robot/")
    texts = [] if "where it was moving" in cell else expected(cell)
    end = time.monotonic() + DEADLINE
    while True:  # what has just begun is not known to everybody yet
        done = subprocess.run(
            ["timeout", "60", "sh", "-c", command],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        said = done.stdout + done.stderr
        if all(text in said for text in texts):
            break
        assert time.monotonic() < end, f"{texts} are not in\n{said}"
