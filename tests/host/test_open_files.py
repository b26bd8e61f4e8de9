"""A machine that allows few open files, or has no loopback: one line, nothing starts."""

import errno
import os
import resource
import shutil
import subprocess
import sys

import pytest

from tests.messages import assert_names, names
from tripod_host.open_files import LEAST

pytest.importorskip("rclpy")


def end_of(
    *words: str, soft: int, hard: int, before: tuple[str, ...] = ()
) -> subprocess.CompletedProcess[str]:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

    return subprocess.run(
        [*before, sys.executable, "-m", "tripod_bringup", *words],
        preexec_fn=limit,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize("command", ["up", "sim", "ik", "driver", "view", "record"])
def test_too_few_open_files_end_in_one_line(command: str) -> None:
    end = end_of(command, soft=20, hard=20)
    name = "tripod up" if command == "up" else command
    assert (end.returncode, end.stderr.count("\n")) == (2, 1)
    assert_names(end.stderr, f"{name}:", "20 files", f"ulimit -n {LEAST}")


def test_a_limit_that_may_be_raised_is_raised() -> None:
    """The node ends for another reason."""
    end = end_of("driver", "port:=nowhere", "rate:=-1.0", soft=20, hard=4096)
    assert end.returncode == 2
    assert_names(end.stderr, "rate")
    assert not names(end.stderr, "ulimit")


@pytest.mark.skipif(
    os.geteuid() != 0 or not shutil.which("unshare"), reason="only root may take the network away"
)
@pytest.mark.parametrize("command", ["up", "sim", "view"])
def test_without_a_loopback_nothing_starts(command: str) -> None:
    end = end_of(command, soft=4096, hard=4096, before=("unshare", "-n", "--"))
    if os.strerror(errno.EPERM) in end.stderr:
        pytest.skip("this root may not make a network of its own")
    assert (end.returncode, end.stderr.count("\n")) == (2, 1)
    assert_names(end.stderr, "loopback", "sudo ip link set lo up")
