"""Files to be locked: where no other user can put anything, and never followed or waited for."""

import os
import tempfile
from pathlib import Path

import pytest

from tests.messages import raises_naming
from tripod_host.locks import open_lock, private_directory


def test_the_runtime_directory_is_taken_if_it_is_ones_own(tmp_path: Path) -> None:
    assert private_directory({"XDG_RUNTIME_DIR": str(tmp_path), "HOME": "/nowhere"}) == tmp_path


@pytest.mark.parametrize("wrong", ["gone", "file", "link", "open to all"])
def test_another_one_is_passed_over(wrong: str, tmp_path: Path) -> None:
    given, home = tmp_path / "run", tmp_path / "home"
    if wrong == "file":
        given.touch()
    elif wrong == "link":
        given.symlink_to("/tmp")
    elif wrong == "open to all":
        given.mkdir()
        given.chmod(0o777)
    found = private_directory({"XDG_RUNTIME_DIR": str(given), "HOME": str(home)})
    assert found == home / ".cache" / "tripod"
    assert found.stat().st_mode & 0o777 == 0o700


def test_without_a_home_it_is_one_among_the_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    found = private_directory({"HOME": "/proc/none"})
    assert found == tmp_path / f"tripod-{os.getuid()}"
    found.chmod(0o777)  # as if another user had been there first
    with raises_naming(OSError, "XDG_RUNTIME_DIR"):
        private_directory({"HOME": "/proc/none"})


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give files away")
def test_a_directory_of_another_user_is_passed_over(tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    theirs.mkdir(mode=0o700)
    os.chown(theirs, 12345, 12345)
    assert private_directory({"XDG_RUNTIME_DIR": str(theirs), "HOME": str(tmp_path)}) != theirs


@pytest.mark.parametrize("kind", ["fifo", "link", "directory"])
def test_only_a_file_is_opened_and_nothing_is_waited_for(kind: str, tmp_path: Path) -> None:
    path, precious = tmp_path / "lock", tmp_path / "precious"
    precious.write_text("kept")
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "link":
        path.symlink_to(precious)
    else:
        path.mkdir()
    with pytest.raises(OSError):
        open_lock(path)
    assert precious.read_text() == "kept"


def test_a_lock_is_closed_to_others(tmp_path: Path) -> None:
    os.close(open_lock(tmp_path / "lock"))
    assert (tmp_path / "lock").stat().st_mode & 0o777 == 0o600
