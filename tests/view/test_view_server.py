"""Who may reach the page, and on which port."""

import http.client
import socket
from pathlib import Path

import pytest

pytest.importorskip("viser")
from websockets.exceptions import InvalidStatus

from tests.view.fake_browser import FakeBrowser
from tripod_view import server as server_module
from tripod_view.server import HOST, PageServer, free_port


@pytest.fixture(scope="module")
def server():
    made = PageServer(0)
    yield made
    made.close()


@pytest.fixture
def taken():
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen(1)
        yield other.getsockname()[1]


def test_it_listens_on_the_loopback_interface_only(server: PageServer) -> None:
    assert (server.get_host(), server.get_port() > 0) == (HOST, True)
    sockets = [line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    own = [s for s in sockets if int(s.split(":")[1], 16) == server.get_port()]
    assert own
    assert all(s.startswith("0100007F:") for s in own)


def test_it_serves_the_page(server: PageServer) -> None:
    connection = http.client.HTTPConnection(HOST, server.get_port(), timeout=10)
    connection.request("GET", "/")
    answer = connection.getresponse()
    assert answer.status == 200
    assert b"<!doctype html>" in answer.read(100).lower()


@pytest.mark.parametrize(
    "origin", [None, "http://127.0.0.1:8080", "http://localhost:3000", "http://localhost"]
)
def test_own_pages_and_programs_are_let_in(server: PageServer, origin: str | None) -> None:
    with FakeBrowser(server.get_port(), origin=origin) as browser:
        browser.wait(lambda: browser.of_kind("ReplayDoneMessage"))


@pytest.mark.parametrize(
    "origin",
    [
        "https://example.com",
        "http://127.0.0.1.example.com",
        "http://example.com:8080",
        "null",
        "http://localhost:1.evil",
    ],
)
def test_foreign_web_sites_are_refused(server: PageServer, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        FakeBrowser(server.get_port(), origin=origin)
    assert refusal.value.response.status_code == 403


def test_no_client_can_publish_the_page(server: PageServer, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *a: opened.append(a))
    with FakeBrowser(server.get_port()) as browser:
        browser.send("ShareUrlRequest")
        browser.send("ShareUrlRequest")
        browser.wait(lambda: browser.of_kind("ReplayDoneMessage"))
    assert server.request_share_url() is None
    assert opened == []


def test_a_taken_port_gives_the_next_free_one(taken: int) -> None:
    assert taken < free_port(taken) < taken + server_module.ATTEMPTS


def test_without_a_free_port_it_says_so_at_once(taken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "ATTEMPTS", 1)
    with pytest.raises(OSError, match=f"no port from {taken} to {taken} can be listened on.*in use"):
        PageServer(taken)


def test_starting_leaves_the_websockets_library_as_it_was(server: PageServer) -> None:
    import websockets.asyncio.server

    assert isinstance(websockets.asyncio.server.serve, type)


def test_starting_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    PageServer(0).close()
    assert capsys.readouterr().out == ""
