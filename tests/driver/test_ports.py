"""Ports: what arrives at the other end, and what they say when something is wrong."""

import errno
import os
import re
import select
import termios
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial

from tests.driver.conftest import DEADLINE
from tests.messages import raises_naming
from tripod_driver.framed import Decoder, encode
from tripod_driver.framed_messages import Hello
from tripod_driver.ports import boards, pseudo_terminal, serial_port
from tripod_driver.ports.boards import FoundPort, find_board, serial_ports
from tripod_driver.ports.choose import choose_port
from tripod_driver.ports.holders import Holder
from tripod_driver.ports.mock import MEMORY, Fault, MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.ports.port import Port, PortError
from tripod_driver.ports.pseudo_terminal import LINGER_TIME, PseudoTerminalPort, unread
from tripod_driver.ports.serial_port import DRAIN_TIME, SerialPort, group_of

PACKET = bytes([255, 10, 13, 17])  # 10, 13 and 17 are what a terminal that is not raw would change


class Clock:
    """Time that passes only while somebody sleeps; takes the place of the module `time`."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


@pytest.fixture
def board() -> Iterator[SimpleNamespace]:
    """A raw pseudo-terminal in place of a board: `near` is the board's end, `path` the computer's device."""
    near, far = os.openpty()
    tty.setraw(far)
    os.set_blocking(near, False)
    yield SimpleNamespace(near=near, path=os.ttyname(far))
    os.close(far)
    os.close(near)


def read_for(count: int, read: Callable[[], bytes]) -> bytes:
    """Return what `read` returns until it is `count` bytes; the kernel hands them over when it likes."""
    deadline, data = time.monotonic() + DEADLINE, b""
    while len(data) < count and time.monotonic() < deadline:
        data += read()
    return data


# serial port ----------------------------------------------------------------------------------------------


def test_serial_port_delivers_bytes_unchanged_and_counts_as_open_under_its_device(board) -> None:
    port = SerialPort(board.path, boot_time=0.0, write_timeout=DEADLINE)
    with port:
        assert port.name == board.path
        port.write(PACKET)
        port.write(PACKET)
        assert read_for(8, lambda: read_all(board.near)) == 2 * PACKET
    with raises_naming(PortError, board.path, "not open"):
        port.write(PACKET)


def test_serial_port_closes_whatever_happens_inside(board) -> None:
    port = SerialPort(board.path)
    with pytest.raises(ZeroDivisionError), port:
        1 / 0  # noqa: B018
    with SerialPort(board.path):  # the lock is free again
        pass
    port.close()  # may be repeated


def test_serial_port_returns_what_came_at_once_and_says_that_the_device_vanished(board) -> None:
    port = SerialPort(board.path)
    with raises_naming(PortError, board.path, "not open"):
        port.read()
    with port:
        assert port.read() == b""
        os.write(board.near, PACKET)
        assert read_for(4, port.read) == PACKET
    near, far = os.openpty()
    port = SerialPort(os.ttyname(far))
    port.open()
    os.close(near)
    with raises_naming(PortError, port.name, "lost", "cable", "power"):
        port.read()
    port.close()
    os.close(far)


def test_serial_port_is_held_exclusively(board) -> None:
    with SerialPort(board.path), raises_naming(PortError, board.path, "in use", "another program"):
        SerialPort(board.path).open()


def test_serial_port_that_takes_no_bytes_fails_within_the_time_out(board, monkeypatch) -> None:
    waits = []

    def wait(*streams_and_time_out) -> tuple[list, list, list]:
        waits.append(streams_and_time_out[-1])
        return select.select(*streams_and_time_out)

    monkeypatch.setattr(serial.serialposix, "select", SimpleNamespace(select=wait, error=select.error))
    with (
        SerialPort(board.path, write_timeout=0.05) as port,
        raises_naming(PortError, board.path, "no data", "0.05 s", "board"),
    ):
        for _ in range(100):
            port.write(bytes(65536))
    assert 0.0 < max(waits) <= 0.05


def test_serial_port_closes_within_the_drain_time_though_the_board_is_stuck(board, monkeypatch) -> None:
    clock, forgotten = Clock(), []
    monkeypatch.setattr(serial_port, "time", clock)
    monkeypatch.setattr(serial.Serial, "out_waiting", 7)
    monkeypatch.setattr(serial.Serial, "reset_output_buffer", lambda port: forgotten.append(port.port))
    port = SerialPort(board.path)
    port.open()
    begun = clock.now
    port.close()
    assert DRAIN_TIME <= clock.now - begun <= DRAIN_TIME + 0.01
    assert forgotten == [board.path]
    with SerialPort(board.path):  # the lock is free again
        pass


def test_serial_port_says_that_the_device_vanished() -> None:
    near, far = os.openpty()
    tty.setraw(far)
    port = SerialPort(os.ttyname(far), write_timeout=DEADLINE)
    port.open()
    path = port.name
    os.close(near)
    with raises_naming(PortError, path, "lost", "Input/output error", "cable", "power"):
        for _ in range(3):
            port.write(PACKET)
    port.close()
    os.close(far)


def test_missing_device_lists_what_there_is(monkeypatch) -> None:
    there = [FoundPort("/dev/ttyUSB3", 0x1A86, 0x7523, "USB Serial", "/dev/serial/by-id/usb-1a86")]
    monkeypatch.setattr(serial_port, "serial_ports", lambda: there)
    with raises_naming(PortError, "/dev/ttyUSB0", "exist", f"serial ports: {there[0]}"):
        SerialPort("/dev/ttyUSB0").open()


def test_missing_permission_names_the_command(monkeypatch) -> None:
    def refuse(path: str, *_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, f"could not open port {path}: Permission denied")

    monkeypatch.setattr(serial_port.serial, "Serial", refuse)
    monkeypatch.setattr(serial_port, "group_of", lambda _: "uucp")
    with raises_naming(PortError, "/dev/ttyACM0", "permission", "sudo usermod -aG uucp $USER", "log out"):
        SerialPort("/dev/ttyACM0").open()


def test_group_is_dialout_unless_the_device_belongs_to_another(board) -> None:
    assert group_of("/dev/null") == "dialout"  # of root, whose group nobody should join
    assert group_of("/dev/nothing") == "dialout"
    assert group_of(board.path) in ("tty", "dialout")


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    for path in (file, tmp_path, Path("/dev/null")):
        with raises_naming(PortError, path, "not a serial port", "serial ports:"):
            SerialPort(str(path)).open()


# whether opening has reset the board ------------------------------------------------------------------------


def uno_at(path: str, **changed: int | None) -> FoundPort:
    return replace(FoundPort(path, 0x2341, 0x0043), **changed)


def set_hang_up(end: int, *, drops: bool) -> None:
    """Let DTR fall, or stay up, when the port is closed, as `stty hupcl` and `stty -hupcl` do."""
    settings = termios.tcgetattr(end)
    settings[2] = settings[2] | termios.HUPCL if drops else settings[2] & ~termios.HUPCL
    termios.tcsetattr(end, termios.TCSANOW, settings)


@pytest.mark.parametrize(
    ("changed", "boot_time", "drops", "shared", "resets"),
    [
        ({}, 2.0, True, False, True),
        ({"vid": 0x1A86, "pid": 0x7523}, 2.0, True, False, True),  # the bridge of most clones of the Nano
        ({"vid": 0xFFFF, "pid": 0x0001}, 2.0, True, False, True),  # an adapter that is not in the list
        ({"vid": None, "pid": None}, 2.0, True, False, False),  # pins of a Raspberry Pi have no DTR
        ({"pid": 0x8036}, 2.0, True, False, False),  # a Leonardo
        ({"pid": 0x8037}, 2.0, True, False, False),  # a Micro
        ({}, 0.0, True, False, False),  # says the user
        ({}, 2.0, False, False, False),  # DTR stayed up when it was closed last
        ({}, 2.0, True, True, False),  # another program holds DTR up
    ],
)
def test_opening_resets_a_board_where_dtr_rises_and_leads_to_its_reset(
    changed: dict[str, int | None],
    boot_time: float,
    drops: bool,
    shared: bool,
    resets: bool,
    board,
    monkeypatch,
) -> None:
    monkeypatch.setattr(serial_port, "serial_ports", lambda: [BUILT_IN, uno_at(board.path, **changed)])
    holding = [Holder(4242, "minicom")] if shared else []
    monkeypatch.setattr(serial_port, "holders", lambda path: holding if path == board.path else [])
    far = os.open(board.path, os.O_RDWR | os.O_NOCTTY)
    set_hang_up(far, drops=drops)
    with SerialPort(board.path, boot_time=boot_time) as port:
        assert port.resets is resets
    os.close(far)


def test_a_pseudo_terminal_resets_nothing(board) -> None:
    with SerialPort(board.path, boot_time=2.0) as port, PseudoTerminalPort() as own:
        assert (port.resets, own.resets) == (False, False)


# finding the board ----------------------------------------------------------------------------------------

UNO = FoundPort("/dev/ttyACM0", 0x2341, 0x0043, "Arduino Uno", "/dev/serial/by-id/usb-Arduino")
CH340 = FoundPort("/dev/ttyUSB0", 0x1A86, 0x7523, "USB Serial")
PHONE = FoundPort("/dev/ttyACM1", 0x18D1, 0x4EE7, "Pixel")
BUILT_IN = FoundPort("/dev/ttyS0")


def test_the_only_known_board_is_found() -> None:
    assert find_board([BUILT_IN, PHONE, UNO]) is UNO
    assert find_board([CH340]) is CH340


@pytest.mark.parametrize(
    ("there", "named"),
    [
        ([], ("no board", "serial ports: none")),
        ([BUILT_IN, PHONE], ("no board", "/dev/ttyS0 (not USB)", "/dev/ttyACM1 (18D1:4EE7, Pixel)")),
        (
            [UNO, PHONE, CH340],
            (
                "2 boards",
                "/dev/ttyACM0 (2341:0043, Arduino Uno, /dev/serial/by-id/usb-Arduino)",
                "/dev/ttyUSB0 (1A86:7523, CH340)",
            ),
        ),
    ],
)
def test_no_board_or_several_are_listed(there: list[FoundPort], named: tuple[str, ...]) -> None:
    with raises_naming(PortError, *named, "--set port=PATH") as caught:
        find_board(there)
    listed = [port.device for port in (UNO, CH340, PHONE, BUILT_IN) if port.device in str(caught.value)]
    assert len(listed) == min(len(there), 2)  # the phone is no board


def test_auto_opens_the_board_that_is_found(board, monkeypatch) -> None:
    found = FoundPort(board.path, 0x2341, 0x0043)
    monkeypatch.setattr(serial_port, "serial_ports", lambda: [BUILT_IN, found])
    port = SerialPort("auto", write_timeout=DEADLINE)
    assert port.name == "auto"
    with port:
        assert port.name == board.path
        port.write(PACKET)
        assert read_for(4, lambda: read_all(board.near)) == PACKET


def test_ports_carry_their_lasting_path(tmp_path: Path, monkeypatch) -> None:
    device = tmp_path / "ttyUSB7"
    device.write_bytes(b"")
    (tmp_path / "by-id").mkdir()
    (tmp_path / "by-id" / "usb-FTDI").symlink_to(device)
    info = SimpleNamespace(device=str(device), vid=0x0403, pid=0x6001, product="FT232R", serial_number=None)
    other = SimpleNamespace(device="/dev/ttyS0", vid=None, pid=None, product=None, serial_number=None)
    monkeypatch.setattr(boards, "comports", lambda: [info, other])
    link = str(tmp_path / "by-id" / "usb-FTDI")
    expected = [BUILT_IN, FoundPort(str(device), 0x0403, 0x6001, "FT232R", link)]
    assert serial_ports(tmp_path / "by-id") == expected


# pseudo-terminal ------------------------------------------------------------------------------------------


def open_reader(port: Port) -> int:
    return os.open(port.name, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)


def read_all(end: int) -> bytes:
    data = b""
    while True:
        try:
            data += os.read(end, 65536)
        except BlockingIOError:
            return data


def test_pseudo_terminal_delivers_bytes_unchanged_to_the_device_that_it_names() -> None:
    with PseudoTerminalPort() as port:
        reader = open_reader(port)
        try:
            port.write(PACKET)
            assert read_for(4, lambda: read_all(reader)) == PACKET
            assert termios.tcgetattr(reader)[3] & termios.ECHO == 0
        finally:
            os.close(reader)
    assert port.name == "pty"
    with raises_naming(PortError, "not open"):
        port.write(PACKET)


def test_pseudo_terminal_returns_what_the_other_program_writes() -> None:
    with PseudoTerminalPort() as port:
        assert port.read() == b""
        writer = os.open(port.name, os.O_WRONLY | os.O_NOCTTY)
        os.write(writer, PACKET)
        data = read_for(4, port.read)
        os.close(writer)
        assert data == PACKET
    with raises_naming(PortError, "not open"):
        port.read()


def test_pseudo_terminal_never_blocks_without_a_reader_and_keeps_the_newest(monkeypatch) -> None:
    clock = Clock()
    monkeypatch.setattr(pseudo_terminal, "time", clock)
    with PseudoTerminalPort() as port:
        packets = [bytes([255, 60 + i % 121, 60 + i // 121 % 121, 100]) for i in range(20_000)]
        begun = clock.now
        for packet in packets:  # no reader comes: a write that waited for one would never end
            port.write(packet)
        assert clock.now == begun
        reader = open_reader(port)
        try:
            last, deadline = b"", time.monotonic() + DEADLINE
            while not last.endswith(packets[-1]) and time.monotonic() < deadline:
                last += read_all(reader)
            assert last.endswith(packets[-1])
            assert b"".join(packets).endswith(last[-4000:])  # nothing is missing between what is kept
        finally:
            os.close(reader)


def test_pseudo_terminal_closes_in_bounded_time_without_a_reader(monkeypatch) -> None:
    clock = Clock()
    monkeypatch.setattr(pseudo_terminal, "time", clock)
    port = PseudoTerminalPort()
    port.open()
    port.write(PACKET)
    far, deadline = open_reader(port), time.monotonic() + DEADLINE
    while unread(far) < len(PACKET):  # the kernel hands the bytes over when it likes
        assert time.monotonic() < deadline
    os.close(far)
    begun = clock.now
    port.close()
    assert LINGER_TIME <= clock.now - begun <= LINGER_TIME + 0.02
    assert port.name == "pty"


def test_the_mock_board_makes_the_pulses_that_the_firmware_makes_unless_built_otherwise() -> None:
    header = (Path(__file__).parents[2] / "firmware" / "protocol.h").read_text()
    ends = tuple(
        int(re.search(rf"^#define {name} (\d+)$", header, re.M)[1]) for name in ("PULSE_MIN", "PULSE_MAX")
    )
    board = MockBoard()
    board.write(encode(Hello(), 1))
    [frame] = Decoder().feed(board.read())
    assert (frame.message.pulse_min, frame.message.pulse_max) == ends


# memory ---------------------------------------------------------------------------------------------------


def test_mock_remembers_what_arrived_up_to_its_memory() -> None:
    with MockPort() as port:
        port.write(PACKET)
        assert port.arrived == PACKET
        port.write(bytes(MEMORY))
        assert port.arrived == bytes(MEMORY)


def test_mock_fails_on_demand() -> None:
    port = MockPort()
    with raises_naming(PortError, "mock", "not open"):
        port.write(PACKET)
    port.open()
    port.fault = Fault.SILENT
    port.write(b"abcd")
    assert port.arrived == b""
    port.fault = Fault.LATE
    port.write(b"efgh")
    assert port.arrived == b""
    port.write(b"ijkl")
    assert port.arrived == b"efgh"
    port.fault = None
    port.write(b"mnop")
    assert port.arrived == b"efghijklmnop"
    port.fault = Fault.SHORT
    with raises_naming(PortError, "mock", "2 of 4 bytes"):
        port.write(b"qrst")
    assert port.arrived == b"efghijklmnopqr"
    port.fault = Fault.CORRUPT
    port.write(bytes([1, 2, 3, 4]))
    port.write(bytes([5, 6, 7]))
    assert port.arrived[-7:] == bytes([1, 2, 3 ^ 128, 4, 5, 6 ^ 128, 7])
    port.fault = Fault.UNPLUGGED
    with raises_naming(PortError, "mock", "lost"):
        port.write(b"u")
    port.close()
    with raises_naming(PortError, "mock", "unplugged"):
        port.open()


# choice ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "kind"),
    [("mock", MockPort), ("pty", PseudoTerminalPort), ("auto", SerialPort), ("/dev/ttyACM0", SerialPort)],
)
def test_word_chooses_the_port(word: str, kind: type[Port]) -> None:
    port = choose_port(word, baud=9600, boot_time=1.5, write_timeout=0.1)
    assert type(port) is kind
    assert port.name == word
    assert port.boot_time == (1.5 if kind is SerialPort else 0.0)


@pytest.mark.parametrize("word", ["", "ttyACM0", "mcok"])
def test_other_words_are_refused_with_the_choices(word: str) -> None:
    with raises_naming(ValueError, f"port '{word}'", "mock, pty, auto", "/dev/ttyACM0"):
        choose_port(word, baud=9600, boot_time=1.5, write_timeout=0.1)
