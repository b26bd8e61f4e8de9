"""Input files: only regular ones, of bounded size, and nothing is waited for."""

import errno
import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.messages import assert_names, raises_naming
from tripod_driver.calibration import CalibrationError
from tripod_driver.calibration_file import read_calibration
from tripod_host.reading import open_file, read_file
from tripod_play.errors import PlayError
from tripod_play.path_file import read_path
from tripod_record.errors import RecordError
from tripod_record.info import read_info
from tripod_sim.errors import SceneError
from tripod_sim.maze.board import read_maze
from tripod_sim.mesh.read import read_solid
from tripod_sim.mesh.read_surface import read_surface
from tripod_sim.scene.file import load_scene
from tripod_study.accuracy.stored import read_study

READERS = {
    "scene": (".toml", load_scene, SceneError),
    "study": (".json", read_study, SceneError),
    "maze": (".txt", lambda path: read_maze(str(path)), SceneError),
    "GiD mesh": (".gidmsh", lambda path: read_solid(path, 1.0, "t4"), SceneError),
    "gmsh mesh": (".msh", lambda path: read_solid(path, 1.0, "t4"), SceneError),
    "VTK mesh": (".vtk", lambda path: read_solid(path, 1.0, "t4"), SceneError),
    "STL surface": (".stl", lambda path: read_surface(path, 1.0, "mesh.source"), SceneError),
    "OBJ surface": (".obj", lambda path: read_surface(path, 1.0, "mesh.source"), SceneError),
    "calibration": (".yaml", read_calibration, CalibrationError),
    "path": (".csv", read_path, PlayError),
    "recording": (".mcap", read_info, RecordError),
}


@pytest.fixture
def special(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Path]]:
    """Names without an ending of what is no file; nobody writes to the FIFO, so that to open it would be to wait."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "device").symlink_to("/dev/zero")
    (tmp_path / "memory").symlink_to("/dev/full")
    listener = socket.socket(socket.AF_UNIX)
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    listener.bind("socket")
    yield {name: tmp_path / name for name in ("fifo", "device", "memory", "socket")}
    listener.close()


@pytest.mark.parametrize("name", READERS)
def test_no_reader_waits_for_what_is_no_file(name: str, special: dict[str, Path], tmp_path: Path) -> None:
    ending, read, error = READERS[name]
    for kind, path in special.items():
        link = tmp_path / f"a-{kind}{ending}"
        link.symlink_to(path)
        with pytest.raises(error) as caught:
            read(link)
        assert "\n" not in str(caught.value)
        assert_names(caught.value, link.name, {"fifo": "pipe", "socket": "a socket"}.get(kind, "a device"))


@pytest.mark.parametrize("name", [n for n in READERS if n != "recording"])
def test_a_file_without_end_is_refused_by_its_size(name: str, tmp_path: Path) -> None:
    ending, read, error = READERS[name]
    path = tmp_path / f"large{ending}"
    with path.open("wb") as file:
        file.truncate(2**43 + 1)  # a hole: it takes no space
    with raises_naming(error, path.name, "larger", "bytes") as caught:
        read(path)
    assert re.search(r"\d bytes", str(caught.value))


@pytest.mark.parametrize("name", [n for n in READERS if n != "recording"])
def test_a_directory_is_no_file(name: str, tmp_path: Path) -> None:
    ending, read, error = READERS[name]
    (tmp_path / f"folder{ending}").mkdir()
    with raises_naming(error, f"folder{ending}", "directory"):
        read(tmp_path / f"folder{ending}")


def test_a_file_is_read_up_to_its_largest_size(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"1234")
    assert read_file(path, 4) == b"1234"
    with raises_naming(OSError, path, "larger", "3 bytes"):
        read_file(path, 3)


def test_a_file_that_grows_is_not_read_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345678")
    small = os.stat_result((0o100644, *[0] * 9))  # as when it was looked at
    monkeypatch.setattr(os, "fstat", lambda _fd: small)
    monkeypatch.setattr(Path, "stat", lambda _path: small)
    with raises_naming(OSError, path, "larger", "4 bytes"):
        read_file(path, 4)


def test_a_name_that_cannot_be_is_an_error_like_others(tmp_path: Path) -> None:
    for name in ("a\0b", "n" * 300, "gone", "file/below"):
        (tmp_path / "file").touch()
        with pytest.raises(OSError) as caught:
            open_file(tmp_path / name, 10)
        assert caught.value.errno in (errno.EINVAL, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR)
