"""Output files: whole or not at all, in place of regular files only."""

import errno
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names, raises_naming
from tripod_host.reading import read_file
from tripod_host.writing import check_place, replaced, replaced_text

ROOT = Path(__file__).parents[2]


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def write(path: Path, data: bytes = b"new") -> None:
    with replaced(path) as file:
        file.write(data)


def test_a_path_may_be_a_text(tmp_path: Path) -> None:
    path = str(tmp_path / "file")
    check_place(path)
    with replaced_text(path) as file:
        file.write("new")
    assert read_file(path, 3) == b"new"


def test_a_file_is_replaced_whole_and_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(0o640)
    with replaced_text(path) as file:
        file.write("ü\n")
        assert path.read_text() == "old"
    assert path.read_bytes() == "ü\n".encode()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert names(tmp_path) == ["file"]


def test_a_new_file_has_the_permissions_that_others_have(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write(tmp_path / "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


@pytest.mark.parametrize("kind", ["fifo", "device", "link", "dangling", "directory"])
def test_nothing_but_a_file_is_replaced(kind: str, tmp_path: Path) -> None:
    path, precious = tmp_path / "out", tmp_path / "precious"
    precious.write_text("kept")
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "device":
        path = Path("/dev/null")
    elif kind == "directory":
        path.mkdir()
    else:
        path.symlink_to(precious if kind == "link" else tmp_path / "gone")
    before = path.lstat()
    for act in (check_place, write):
        with pytest.raises(OSError) as caught:
            act(path)
        assert caught.value.filename == str(path)
        assert caught.value.errno in (errno.EINVAL, errno.EISDIR)
    assert (path.lstat().st_ino, path.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert precious.read_text() == "kept"
    assert not [name for name in names(tmp_path) if name.endswith(".part")]


@pytest.mark.skipif(os.getuid() != 0, reason="only root can make a device node")
def test_root_does_not_replace_a_device_node(tmp_path: Path) -> None:
    path = tmp_path / "null"
    os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
    with raises_naming(OSError, path, "device"):
        write(path)
    assert stat.S_ISCHR(path.lstat().st_mode)


def test_a_device_that_comes_while_the_work_lasts_stays(tmp_path: Path) -> None:
    path = tmp_path / "out"
    with raises_naming(OSError, path, "pipe"), replaced(path) as file:
        file.write(b"new")
        os.mkfifo(path)
    assert stat.S_ISFIFO(path.lstat().st_mode)
    assert names(tmp_path) == ["out"]


def test_files_called_part_are_nobody_elses_business(tmp_path: Path) -> None:
    for name in ("out.npz.part", "out.part"):
        (tmp_path / name).write_text("mine")
    check_place(tmp_path / "out.npz")
    write(tmp_path / "out.npz")
    assert {name: (tmp_path / name).read_text() for name in names(tmp_path)} == {
        "out.npz": "new",
        "out.npz.part": "mine",
        "out.part": "mine",
    }


def test_what_fails_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "out"
    path.write_text("old")
    with pytest.raises(OSError) as caught, replaced(path) as file:
        file.write(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert caught.value.filename == str(path), "the file is named, where the system named none"
    assert_names(caught.value.strerror, "free space", "another")
    assert path.read_text() == "old" and names(tmp_path) == ["out"]


def test_a_vanished_directory_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(OSError) as caught, replaced(folder / "out") as file:
        file.write(b"new")
        next(folder.iterdir()).unlink()
        folder.rmdir()
    assert caught.value.filename == str(folder / "out")
    assert_names(caught.value.strerror, "no directory", folder)


FULL = """
import sys
from pathlib import Path
from tripod_host.writing import replaced
with replaced(Path(sys.argv[1])) as file:
    file.write(b"x" * 100_000)
"""


def test_a_limit_of_the_system_leaves_nothing_behind(tmp_path: Path) -> None:
    command = f'ulimit -f 10; exec "{sys.executable}" -c "$0" "{tmp_path}/out"'
    done = subprocess.run(
        ["bash", "-c", command, FULL], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert os.strerror(errno.EFBIG) in done.stderr
    assert names(tmp_path) == []


INTERRUPTED = """
import os, signal, sys
from pathlib import Path
from tripod_host import stop
from tripod_host.writing import replaced
stop.end_at_once()
with replaced(Path(sys.argv[1])) as file:
    file.write(b"half")
    os.kill(os.getpid(), signal.SIGTERM)
    while True: pass
"""


def test_a_signal_in_the_midst_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("old")
    words = [sys.executable, "-c", INTERRUPTED, str(tmp_path / "out")]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (143, "")
    assert names(tmp_path) == ["out"] and (tmp_path / "out").read_text() == "old"
