"""How far the messages of ROS reach: what keep_local sets, and which sockets a node then has."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.graph.test_run import DEADLINE, finish, start
from tests.messages import assert_names, raises_naming
from tripod_graph import loopback
from tripod_graph.loopback import (
    CHOICES,
    OWN_PROFILES,
    PROFILES,
    RANGE,
    LoopbackError,
    check_loopback,
    keep_local,
)


@pytest.fixture
def nothing_chosen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> pytest.MonkeyPatch:
    for name in (RANGE, *CHOICES, "RMW_IMPLEMENTATION", "ROS_DISTRO"):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.chdir(tmp_path)
    return monkeypatch


def chosen() -> tuple[str, str | None]:
    return os.environ[RANGE], os.environ.get(PROFILES)


def test_this_machine_alone_unless_the_subnet_is_asked_for_and_back(nothing_chosen) -> None:
    for _ in range(2):  # a child inherits it, and says the same again
        keep_local()
        assert chosen() == ("SYSTEM_DEFAULT", str(OWN_PROFILES))
    keep_local(subnet=True)
    assert chosen() == ("SUBNET", None)
    keep_local()
    assert chosen() == ("SYSTEM_DEFAULT", str(OWN_PROFILES))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        (PROFILES, "/my.xml"),
        ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4"),
        ("ROS_STATIC_PEERS", "10.0.0.2"),
        ("ROS_DISCOVERY_SERVER", "127.0.0.1:11811"),
        ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
        ("ROS_DISTRO", "kilted"),
    ],
)
def test_who_has_chosen_keeps_his_choice(nothing_chosen, name: str, value: str) -> None:
    nothing_chosen.setenv(name, value)
    keep_local()
    assert chosen() == ("LOCALHOST", value if name == PROFILES else None)
    assert os.environ[name] == value
    keep_local(subnet=True)
    assert chosen() == ("SUBNET", value if name == PROFILES else None)


def test_a_profile_in_the_working_directory_is_a_choice_too(nothing_chosen) -> None:
    Path("DEFAULT_FASTRTPS_PROFILES.xml").write_text("<dds/>")
    keep_local()
    assert chosen() == ("LOCALHOST", None)


def addresses(pid: int) -> list[str]:
    """Return the local addresses of the UDP sockets of a process."""
    links = [entry.readlink().name for entry in Path(f"/proc/{pid}/fd").iterdir()]
    own = {found[1] for link in links if (found := re.fullmatch(r"socket:\[(\d+)\]", link))}
    rows = [
        line.split()
        for name in ("udp", "udp6")
        for line in Path(f"/proc/net/{name}").read_text().splitlines()
    ]
    return [row[1].split(":")[0] for row in rows if len(row) > 9 and row[9] in own]


@pytest.mark.ros
@pytest.mark.usefixtures("domain")
@pytest.mark.parametrize("subnet", [False, True])
def test_a_node_has_no_socket_on_any_other_interface_unless_asked_to(nothing_chosen, subnet: bool) -> None:
    process = start(arguments=("--subnet",) if subnet else ())
    while process.stdout.readline() != "ready\n":
        assert process.poll() is None
    found, until = [], time.monotonic() + DEADLINE
    while len(found) < 3 and time.monotonic() < until:
        found = addresses(process.pid)
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    code, _, errors = finish(process)
    assert len(found) >= 3
    assert (set(found) == {"0100007F"}) is not subnet
    assert (code, errors) == (0, "")


def test_where_loopback_works_there_is_no_trouble() -> None:
    check_loopback()


def test_where_packets_to_this_machine_take_another_way_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class Lost(loopback.socket.socket):
        def sendto(self, data: bytes, _: object) -> int:
            return len(data)

    monkeypatch.setattr(loopback.socket, "socket", Lost)
    monkeypatch.setattr(loopback, "PATIENCE", 0.05)
    with raises_naming(LoopbackError, "loopback", "timed out", "sudo ip link set lo up"):
        check_loopback()


DOWN = """
import errno, os, socket, sys

class Down(socket.socket):
    def sendto(self, *_):
        raise OSError(errno.ENETUNREACH, os.strerror(errno.ENETUNREACH))

socket.socket = Down
"""


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("probe", "from tripod_graph.run import run_node; sys.exit(run_node('probe', None, []))"),
        ("tripod up", "sys.argv = ['tripod', 'up']; from tripod_bringup.cli import main; main()"),
    ],
)
def test_where_loopback_is_down_one_line_says_so(name: str, code: str) -> None:
    command = [sys.executable, "-c", DOWN + code]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=DEADLINE)
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert_names(ended.stderr, f"{name}: ", "loopback", "Network is unreachable", "sudo ip link set lo up")


def test_bodies_of_25_000_nodes_have_room_in_shared_memory() -> None:
    """Those for whom there is none go in parts, of which some are lost: of 30 pictures a second 3 came."""
    found = re.search(r"<segment_size>(\d+)</segment_size>", OWN_PROFILES.read_text())
    assert found
    assert int(found[1]) >= 4 * 25_000 * 3 * 8
