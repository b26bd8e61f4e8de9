"""What is remembered of a board outlives the process, and nothing that another has put there is believed."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.decisions import said
from tests.driver.bench import Bench
from tests.messages import assert_names
from tripod_driver.memory import LINE_SIZE, Memory, state_folder
from tripod_driver.ports.boards import FoundPort
from tripod_driver.safety import State
from tripod_graph.mode import Mode

BOARD = "2341:0043:85430353531351B0B1A2"
PULSES = (14995, 15000, 24000)


def remembering(folder: Path, board: str = BOARD, **options) -> Memory:
    memory = Memory(folder, **options)
    memory.turn_to(board)
    return memory


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A file with what a driver that is gone has kept."""
    memory = remembering(tmp_path / "state")
    memory.keep(PULSES)
    assert memory.path is not None
    return memory.path


def test_what_was_kept_is_there_after_the_process_was_killed(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys; from pathlib import Path; from tripod_driver.memory import Memory\n"
        f"memory = Memory(Path(sys.argv[1])); memory.turn_to({BOARD!r})\n"
        f"[memory.keep((n, n, n)) for n in range(5000, 15000)]; memory.keep({PULSES})\n"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=Path(__file__).parents[2], check=False
    )
    assert run.returncode == -signal.SIGKILL
    assert remembering(tmp_path).recall() == (PULSES, True)
    assert remembering(tmp_path, "another board").recall() == (None, False)


def test_the_file_is_small_and_its_owners_alone(file: Path) -> None:
    assert file.stat().st_size == LINE_SIZE
    assert file.stat().st_mode & 0o777 == 0o600
    assert file.parent.stat().st_mode & 0o777 == 0o700


def test_of_an_earlier_boot_it_is_only_a_guess(file: Path, tmp_path: Path) -> None:
    boot = tmp_path / "boot_id"
    boot.write_text("11111111-2222-3333-4444-555555555555\n")
    assert remembering(file.parent, boot=boot).recall() == (PULSES, False)
    assert remembering(file.parent, boot=tmp_path / "absent").recall() == (PULSES, False)


@pytest.mark.parametrize(
    "content", [b"x", b"GIF89a" * 20, b"\0" * LINE_SIZE, b"tripod place 1", b"\xff" * 5000]
)
def test_a_damaged_file_is_told_in_one_line_and_made_anew(content: bytes, file: Path) -> None:
    file.write_bytes(content)
    memory = remembering(file.parent)
    assert memory.recall() == (None, False)
    assert_names(memory.warning, file, "damaged", "unknown", "servos")
    assert "\n" not in memory.warning
    memory.keep(PULSES)
    assert remembering(file.parent).recall() == (PULSES, True)


def test_every_damage_to_one_byte_is_noticed(file: Path) -> None:
    sound = file.read_bytes()
    for i in range(LINE_SIZE):
        file.write_bytes(sound[:i] + bytes([sound[i] ^ 1]) + sound[i + 1 :])
        assert remembering(file.parent).recall() == (None, False), i
    file.write_bytes(sound[:-1])
    assert remembering(file.parent).recall() == (None, False)


def _directory(path: Path) -> None:
    path.mkdir()


def _link(path: Path) -> None:
    path.with_name("elsewhere").write_text("somebody's")
    path.symlink_to("elsewhere")


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _open_to_others(path: Path) -> None:
    path.write_text("")
    path.chmod(0o666)


def _second_name(path: Path) -> None:
    path.with_name("elsewhere").write_text("somebody's")
    path.with_name("elsewhere").chmod(0o600)
    path.hardlink_to(path.with_name("elsewhere"))


@pytest.mark.parametrize("make", [_directory, _link, _fifo, _open_to_others, _second_name])
def test_what_is_no_file_of_its_own_is_told_and_neither_read_nor_written(make, file: Path) -> None:
    file.unlink()
    make(file)
    memory = remembering(file.parent)
    memory.keep(PULSES)
    assert memory.path is None
    assert_names(memory.warning, file)
    assert "\n" not in memory.warning
    assert memory.recall() == (PULSES, True)  # as long as the process lives
    elsewhere = file.with_name("elsewhere")
    assert not elsewhere.exists() or elsewhere.read_text() == "somebody's"


def test_a_file_of_another_user_is_not_believed(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 4242)
    memory = remembering(file.parent)
    assert memory.recall() == (None, False)
    assert_names(memory.warning, file, f"user {file.stat().st_uid}", 4242)


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file")
    memory = remembering(tmp_path / "state" / "tripod")
    assert_names(memory.warning, tmp_path / "state" / "tripod", "servos", "crash")
    memory.keep(PULSES)
    assert memory.recall() == (PULSES, True)


def test_a_file_that_can_no_longer_be_written_is_emptied_so_that_it_tells_nothing_old(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = remembering(file.parent)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    memory.keep((9000, 9000, 9000))
    assert_names(memory.warning, file, "No space left")
    monkeypatch.undo()
    assert remembering(file.parent).recall() == (None, False)


def test_names_that_look_alike_have_files_of_their_own(tmp_path: Path) -> None:
    names = ["/dev/ttyUSB0", "/dev/ttyUSB.0", "../../etc/passwd", "a" * 300, "a" * 301, "\udcff", "\n"]
    paths = [remembering(tmp_path, name).path for name in names]
    assert len(set(paths)) == len(names)
    assert all(path is not None and path.parent == tmp_path for path in paths)


def test_the_folder_follows_the_environment() -> None:
    assert state_folder({"XDG_STATE_HOME": "/elsewhere"}) == Path("/elsewhere/tripod")
    assert state_folder({"XDG_STATE_HOME": "relative"}) == Path.home() / ".local" / "state" / "tripod"


def test_a_board_is_known_by_its_serial_number_and_else_by_its_port() -> None:
    a, b = (FoundPort(f"/dev/ttyACM{i}", 0x2341, 0x43, serial_number="85430353") for i in (0, 1))
    assert a.identity == b.identity == "2341:0043:85430353"
    c, d = (FoundPort(f"/dev/ttyUSB{i}", 0x1A86, 0x7523) for i in (0, 1))
    assert c.identity != d.identity


def test_a_driver_ramps_from_what_the_one_before_it_had_sent_though_the_board_lost_its_power(
    tmp_path: Path,
) -> None:
    def driven(**options) -> Bench:
        bench = Bench(known=False, memory=Memory(tmp_path), **options)
        bench.port.__class__ = type("Named", (bench.port.__class__,), {"identity": BOARD})
        bench.safety.control_mode(said(Mode.TELEOP, 1.0), 1.0, bench.clock.now)
        bench.run(0.1)
        return bench

    first = driven()
    assert not first.safety.place_known  # the board was just switched on
    first.goto(-0.7, -0.8, -0.9, time=1.0)
    first.run(1.5)
    assert first.safety.place_known
    second = driven()
    assert (second.safety.state, second.safety.place_known) == (State.HOLDING, True)
    assert second.sent == []
    second.goto(-1.5, -1.5, -1.5)
    second.run(0.02)
    assert second.sent[0][1] == pytest.approx(first.sent[-1][1], abs=1e-9)
