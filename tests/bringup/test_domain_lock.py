"""One `tripod up` a domain and namespace: the lock, and what it says of its holder."""

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import raises_naming
from tripod_bringup.lock import (
    DomainBusyError,
    DomainError,
    domain_id,
    only_one,
)

ROOT = Path(__file__).parents[2]
HOLD = """
import sys
from pathlib import Path
from tripod_bringup.lock import only_one
with only_one(7, "/", Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize(("text", "domain"), [(None, 0), ("", 0), (" 12 ", 12), ("232", 232)])
def test_domain_is_read_from_the_environment(text: str | None, domain: int) -> None:
    assert domain_id({} if text is None else {"ROS_DOMAIN_ID": text}) == domain


@pytest.mark.parametrize("text", ["233", "-1", "a", "1.5", "²"])
def test_a_domain_out_of_range_is_refused_by_its_value(text: str) -> None:
    with raises_naming(DomainError, "ROS_DOMAIN_ID", f"'{text}'", "0 to 232"):
        domain_id({"ROS_DOMAIN_ID": text})


def test_a_second_holder_is_refused_and_told_the_process_of_the_first(tmp_path: Path) -> None:
    with only_one(7, "/", tmp_path):
        named = (f"process {os.getpid()}", "domain 7", "namespace /", "--namespace", "ROS_DOMAIN_ID")
        with raises_naming(DomainBusyError, *named) as caught, only_one(7, "/", tmp_path):
            pytest.fail("held twice")
        assert caught.value.pid == os.getpid()
        with only_one(8, "/", tmp_path), only_one(7, "/left", tmp_path), only_one(7, "/left/arm", tmp_path):
            pass
    with only_one(7, "/", tmp_path):
        pass


def test_a_killed_holder_leaves_no_lock(tmp_path: Path) -> None:
    environment = dict(os.environ, PYTHONPATH=str(ROOT))
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, text=True, env=environment) as holder:
        try:
            assert holder.stdout is not None and holder.stdout.readline() == "held\n"
            with pytest.raises(DomainBusyError) as caught, only_one(7, "/", tmp_path):
                pytest.fail("held twice")
            assert caught.value.pid == holder.pid
        finally:
            holder.kill()
    with only_one(7, "/", tmp_path) as path:
        assert path.read_text() == f"{os.getpid()}\n"


def test_the_lock_file_is_never_a_link_to_another_file(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("kept")
    with only_one(7, "/", tmp_path) as path:
        pass
    path.unlink()
    path.symlink_to(precious)
    with pytest.raises(OSError), only_one(7, "/", tmp_path):
        pytest.fail("followed the link")
    assert precious.read_text() == "kept"


def test_a_file_system_without_locks_is_told_by_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(OSError, match="No locks available") as caught, only_one(7, "/", tmp_path):
        pass
    assert Path(caught.value.filename).parent == tmp_path
