"""How a node starts and ends, seen from outside: exit codes, messages, and that it is always closed."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from tests.messages import assert_names, line_naming

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("domain")]

DEADLINE = 60.0  # [s], for a loaded machine
PROGRAM = """
import os, sys
from tripod_graph.run import run_node

def make():
    print(
        "range", os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"], "FASTRTPS_DEFAULT_PROFILES_FILE" in os.environ, flush=True
    )
    if {failing!r} == "make":
        raise ValueError("a bad parameter")
    from rclpy.node import Node

    class Probe(Node):
        def __init__(self):
            super().__init__("probe")
            os.write(1, b"ready\\n")  # whole at once: a signal may come before `print` has left its buffer
            if {failing!r} == "run":
                self.create_timer(0.01, lambda: 1 / 0)
            if {failing!r} == "nothing, but it ticks":
                self.create_timer(0.01, lambda: os.write(1, b"tick\\n"))

        def close(self):
            os.write(1, b"closed\\n")
            if {failing!r} == "close":
                raise RuntimeError("the port is gone")

    return Probe()

sys.exit(run_node("probe", make, {arguments!r}))
"""


def start(failing: str = "", arguments: tuple[str, ...] = (), **options) -> subprocess.Popen[str]:
    environment = {
        k: v for k, v in os.environ.items() if k not in ("TRIPOD_SUBNET", "ROS_AUTOMATIC_DISCOVERY_RANGE")
    }
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(failing=failing, arguments=list(arguments))],
        cwd=Path(__file__).parents[2],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def finish(process: subprocess.Popen[str], number: signal.Signals | None = None) -> tuple[int, str, str]:
    """Send the signal once the node is ready; return exit code, output and errors."""
    head = ""
    try:
        if number is not None:
            assert process.stdout is not None
            for line in process.stdout:
                head += line
                if line == "ready\n":
                    break
            process.send_signal(number)
        out, errors = process.communicate(timeout=DEADLINE)
    finally:
        process.kill()
    return process.returncode, head + out, errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_in_order(number: signal.Signals) -> None:
    code, out, errors = finish(start(), number)
    assert (code, errors) == (0, "")
    assert out == "range SYSTEM_DEFAULT True\nready\nclosed\n"


def test_it_outlives_its_terminal_under_nohup() -> None:
    process = start("nothing, but it ticks", preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    assert process.stdout is not None
    while process.stdout.readline() != "tick\n":
        assert process.poll() is None
    process.send_signal(signal.SIGHUP)
    for _ in range(50):  # more than what may have waited in the pipe
        assert process.stdout.readline() == "tick\n"
    process.send_signal(signal.SIGINT)
    code, out, errors = finish(process)
    assert (code, errors) == (0, "")
    assert out.replace("tick\n", "") == "closed\n"


def test_an_exception_while_running_is_named_and_the_node_closed() -> None:
    code, out, errors = finish(start("run"))
    assert code == 1
    assert out.endswith("closed\n")
    line_naming(errors, "probe", "stopped", "ZeroDivisionError", "division by zero")


def test_a_failure_to_close_is_reported_by_exit_code() -> None:
    code, _, errors = finish(start("close"), signal.SIGINT)
    assert code == 1
    assert errors.count("\n") == 1
    assert_names(errors, "probe", "closing", "RuntimeError", "port is gone")


def test_a_node_that_cannot_be_made_is_refused_in_one_line() -> None:
    code, out, errors = finish(start("make"))
    assert (code, out, errors.count("\n")) == (2, "range SYSTEM_DEFAULT True\n", 1)
    assert_names(errors, "probe", "a bad parameter")


def test_a_word_it_does_not_understand_is_refused_in_one_line() -> None:
    code, out, errors = finish(start(arguments=("port=mock",)))
    assert (code, out, errors.count("\n")) == (2, "", 1)
    assert_names(errors, "probe", "'port=mock'", "NAME:=VALUE")


def test_discovery_reaches_the_subnet_only_when_asked() -> None:
    _, out, _ = finish(start("make", arguments=("--subnet",)))  # no node is made: nothing leaves the machine
    assert out == "range SUBNET False\n"
