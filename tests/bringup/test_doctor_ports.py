"""What the doctor says about serial ports."""

import os
import re
from pathlib import Path

import pytest

from tests.bringup.held import held_terminal
from tests.messages import assert_names, names
from tripod_bringup import doctor_ports
from tripod_bringup.check import Check, Verdict
from tripod_bringup.doctor_ports import HINT, MUTE, RULES, check_ports
from tripod_driver.ask import Answer, ask
from tripod_driver.ports.boards import BOARDS, FoundPort
from tripod_driver.ports.holders import Holder, holders
from tripod_driver.ports.mock import MockPort
from tripod_driver.ports.mock_board import MockBoard
from tripod_driver.ports.port import PortError

UNO = FoundPort("/dev/ttyACM0", 0x2341, 0x0043, "Arduino Uno", "/dev/serial/by-id/usb-Arduino")
PHONE = FoundPort("/dev/ttyACM1", 0x18D1, 0x4EE7, "Pixel")
BUILT_IN = FoundPort("/dev/ttyS0")


def check(*ports: FoundPort, **options) -> list[Check]:
    options = {"accessible": lambda _: True, "held_by": lambda _: [], **options}
    return check_ports(ports, user="ada", **options)


def test_no_port_is_fine_and_on_board_ports_do_not_count() -> None:
    (found,) = check(BUILT_IN)
    assert found.verdict is Verdict.OK
    assert_names(found.advice, "tripod up", "simulates")


def test_each_port_is_told_with_its_identity_and_lasting_name() -> None:
    uno, phone = check(BUILT_IN, UNO, PHONE)
    assert {uno.name, phone.name} == {"serial port"}
    assert {uno.verdict, phone.verdict} == {Verdict.OK}
    assert_names(uno.found, "/dev/ttyACM0", "2341:0043", "Arduino Uno", "/dev/serial/by-id/usb-Arduino")
    assert uno.advice == HINT
    assert_names(HINT, "tripod doctor --ask", "firmware", "resets the board")
    assert_names(phone.found, "/dev/ttyACM1", "18D1:4EE7", "Pixel", "no known board")
    assert not names(uno.found, "no known board")
    assert_names(phone.advice, "--set port=/dev/ttyACM1")


def test_a_port_without_permission_fails_with_both_remedies() -> None:
    found, other = check(UNO, PHONE, accessible=lambda device: device == PHONE.device)
    assert (found.verdict, other.verdict) == (Verdict.FAIL, Verdict.OK)
    assert_names(found.advice, "/dev/ttyACM0", "sudo usermod -aG dialout ada", "log in again")
    assert_names(found.advice, f"sudo cp {RULES} /etc/udev/rules.d/")


def test_a_port_in_use_is_not_touched_and_its_holder_is_named() -> None:
    def never(_: str) -> Answer:
        raise AssertionError("a port in use was opened")

    (found,) = check(UNO, held_by=lambda _: [Holder(42, "minicom")], answer_of=never)
    assert found.verdict is Verdict.WARN
    assert_names(found.found, UNO.device, "in use", "minicom", "process 42")


def test_firmware_and_round_trip_are_told_of_known_boards_when_asked_for() -> None:
    asked = []

    def answer(device: str) -> Answer:
        asked.append(device)
        return Answer("1.2", "brown-out", 0.0031)

    found, _ = check(UNO, PHONE, answer_of=answer)
    assert found.verdict is Verdict.OK
    assert_names(found.found, UNO.device, "firmware 1.2", "3.1 ms", "reset", "brown-out")
    assert asked == [UNO.device]
    (mute,) = check(UNO, answer_of=lambda _: Answer(message="no answer"))
    assert (mute.verdict, mute.advice) == (Verdict.WARN, MUTE)
    assert_names(mute.found, UNO.device, "no answer")
    assert_names(MUTE, "--set protocol=legacy", "tripod flash")

    def lost(device: str) -> Answer:
        raise PortError(f"{device} was lost")

    (failed,) = check(UNO, answer_of=lost)
    assert failed.verdict is Verdict.FAIL
    assert_names(failed.advice, "/dev/ttyACM0", "lost")


def test_asking_opens_the_port_times_the_answer_and_closes_it() -> None:
    now = [5.0]
    board = MockBoard()
    port = MockPort(board, boot_time=1.0)

    def sleep(duration: float) -> None:
        now[0] += duration

    answer = ask(port, clock=lambda: now[0], sleep=sleep)
    assert (answer.firmware, answer.message) == ("0.0", "")
    assert answer.round_trip == pytest.approx(0.001)
    assert (port.is_open, board.history) == (False, [])
    deaf = MockPort(boot_time=1.0)
    begun = now[0]
    assert_names(ask(deaf, clock=lambda: now[0], sleep=sleep).message, "no answer", "firmware", "baud")
    assert now[0] - begun == pytest.approx(2.0, abs=0.01)


def test_the_program_that_has_a_device_open_is_found(tmp_path: Path) -> None:
    device = tmp_path / "ttyX"
    device.touch()
    link = tmp_path / "by-id"
    link.symlink_to(device)
    proc = tmp_path / "proc"
    for pid, name, opened in (
        ("7", "minicom", device),
        ("8", "bash", tmp_path / "other"),
        (str(os.getpid()), "us", device),
    ):
        (proc / pid / "fd").mkdir(parents=True)
        (proc / pid / "fd" / "3").symlink_to(opened)
        (proc / pid / "comm").write_text(f"{name}\n")
    (proc / "9").mkdir()  # just ended
    assert holders(str(link), proc) == [Holder(7, "minicom")]


def test_a_program_that_has_a_terminal_open_is_seen() -> None:
    with held_terminal() as (name, pid):
        assert [holder.pid for holder in holders(name)] == [pid]


def test_the_udev_rule_is_there_and_knows_the_boards_that_the_driver_knows() -> None:
    text = doctor_ports.RULES.read_text()
    pairs = re.findall(r'idVendor}=="([0-9a-f]{4})", ATTRS{idProduct}=="([0-9a-f]{4})"', text)
    assert {(int(v, 16), int(p, 16)) for v, p in pairs} == set(BOARDS)
    assert 'TAG+="uaccess"' in text and "0666" not in text
