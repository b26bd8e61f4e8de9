"""`tripod flash`: what it would run, and what it says when something is missing."""

from pathlib import Path

import pytest

from tests.bringup.held import held_terminal
from tests.messages import assert_names
from tripod_bringup import flash
from tripod_bringup.flash import INSTALL, flash_command
from tripod_driver.ports.boards import FoundPort


@pytest.fixture
def firmware(tmp_path: Path) -> Path:
    file = tmp_path / "tripod.hex"
    file.touch()
    return file


@pytest.fixture
def device(tmp_path: Path) -> str:
    """A path that exists and that nobody has open."""
    path = tmp_path / "ttyBoard"
    path.touch()
    return str(path)


def attempt(
    firmware: Path | None, port: str, capsys, *, code: int = 0, avrdude: str | None = "/bin/avrdude", **more
):
    runs: list[list[str]] = []

    def run(command) -> int:
        runs.append(list(command))
        return code

    result = flash_command(port, firmware, which=lambda _: avrdude, run=run, **{"baud": 115200, **more})
    return result, runs, capsys.readouterr()


def test_it_runs_avrdude_on_the_board_that_is_found(firmware: Path, monkeypatch, capsys, device) -> None:
    monkeypatch.setattr(flash, "serial_ports", lambda: [FoundPort(device, 0x2341, 0x0043)])
    code, runs, said = attempt(firmware, "auto", capsys)
    expected = "/bin/avrdude -p atmega328p -c arduino -P " + f"{device} -b 115200 -D -U flash:w:{firmware}:i"
    assert (code, runs) == (0, [expected.split(" ")])
    assert said.out.startswith(expected + "\n")
    code, runs, _ = attempt(firmware, device, capsys, dry_run=True)
    assert (code, runs) == (0, [])


def test_an_elf_is_written_as_one(tmp_path: Path, capsys, device) -> None:
    elf = tmp_path / "tripod.elf"
    elf.touch()
    _, (command,), _ = attempt(elf, device, capsys, baud=57600)
    assert command[-1] == f"flash:w:{elf}:e"
    assert "57600" in command


@pytest.mark.parametrize("built", [True, False])
def test_a_missing_avrdude_is_told_with_the_package(
    built: bool, firmware: Path, monkeypatch, capsys, device
) -> None:
    """Before all else: nothing that is built or plugged in helps without it."""
    monkeypatch.setattr(flash, "FIRMWARE", Path("/nowhere"))
    code, runs, said = attempt(firmware if built else None, device, capsys, avrdude=None)
    assert (code, runs, said.err) == (2, [], f"tripod flash: {INSTALL}\n")
    assert_names(INSTALL, "avrdude", "sudo apt-get install avrdude")


def test_missing_firmware_names_the_build_and_builds_nothing(
    tmp_path: Path, monkeypatch, capsys, device
) -> None:
    monkeypatch.setattr(flash, "FIRMWARE", tmp_path)
    code, runs, said = attempt(None, device, capsys)
    assert (code, runs) == (2, [])
    assert_names(said.err, "tripod flash: ", f"{tmp_path}/build/tripod.hex", f"make -C {tmp_path}")
    assert said.err.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["ttyBoard"]
    text = tmp_path / "notes.txt"
    text.touch()
    assert_names(attempt(text, device, capsys)[2].err, "tripod flash: ", text, ".hex", ".elf")


def test_ports_that_cannot_be_used_are_told(firmware: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(flash, "serial_ports", list)
    code, runs, said = attempt(firmware, "auto", capsys)
    assert (code, runs) == (2, [])
    assert_names(said.err, "tripod flash: ", "no board", "ports: none", "--port PATH")
    gone = attempt(firmware, "/dev/nothing", capsys)[2].err
    assert_names(gone, "tripod flash: ", "/dev/nothing", "not exist", "tripod doctor")
    with held_terminal() as (name, pid):
        said = attempt(firmware, name, capsys)[2].err
    assert_names(said, "tripod flash: ", name, "in use", f"process {pid}", "stop")


def test_a_failure_of_avrdude_is_passed_on_with_what_to_try(firmware: Path, capsys, device) -> None:
    code, _, said = attempt(firmware, device, capsys, code=1)
    assert code == 1
    assert_names(said.err, "tripod flash: ", "avrdude", "code 1", "old boot loader", "--baud 57600")
    assert said.err.count("\n") == 1
