"""Who may reach the page, at which address."""

import http.client
import re
import socket
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from tests.messages import assert_names, raises_naming
from tests.view.fake_browser import FakeBrowser
from tripod_view import server as server_module
from tripod_view.channel import Channel
from tripod_view.drawing import Drawing
from tripod_view.events import Inbox
from tripod_view.gate import Gate, RefusedError
from tripod_view.server import HOST, PageServer
from tripod_view.stream import Stream


def page_server(port: int = 0, drawing: Drawing | None = None) -> PageServer:
    """Return a server of `drawing`, or of one node."""
    inbox = Inbox(lambda: None)
    if drawing is None:
        drawing = Drawing()
        drawing.add("/one", "group", axes=0.0)
    return PageServer(port, Channel(inbox), Stream(drawing, inbox))


@pytest.fixture(scope="module")
def server():
    made = page_server()
    yield made
    made.close()


@pytest.fixture
def taken():
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen(1)
        yield other.getsockname()[1]


def test_it_listens_on_the_loopback_interface_only(server: PageServer) -> None:
    assert server.port > 0
    sockets = [line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    own = [s for s in sockets if int(s.split(":")[1], 16) == server.port]
    assert own
    assert all(s.startswith("0100007F:") for s in own)


def get(server: PageServer, path: str, **headers: str) -> tuple[int, bytes, http.client.HTTPMessage]:
    """Return status, content and headers of the answer to a request for `path`."""
    connection = http.client.HTTPConnection(HOST, server.port, timeout=60)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read(), answer.headers


def token(server: PageServer) -> str:
    return server.url.rpartition("/")[2]


def test_it_serves_the_page_at_its_address(server: PageServer) -> None:
    for path in (
        f"/{token(server)}",
        f"/{token(server)}/",
        f"/{token(server)}/?darkMode",
        f"/{token(server)}?a=/b",
    ):
        status, content, _ = get(server, path)
        assert (status, b"<!doctype html>" in content[:100].lower()) == (200, True)


def test_every_address_has_a_token_of_its_own_that_nobody_guesses(server: PageServer) -> None:
    other = page_server()
    try:
        assert token(other) != token(server)
        assert re.fullmatch(r"[\w-]{22}", token(other))  # 16 random bytes
        assert get(other, f"/{token(server)}")[0] == 403
    finally:
        other.close()


def wrong_paths(right: str) -> list[str]:
    tokens = ["", "index.html", right[:-1], right + "x", right.swapcase()]
    return [*(f"/{token}" for token in tokens), f"//{right}", f"/x/{right}", f"/?{right}"]


def test_without_the_token_nothing_is_served_and_the_reason_told(server: PageServer) -> None:
    for path in [*wrong_paths(token(server)), "/%00", "/../x"]:
        status, content, _ = get(server, path)
        assert status == 403, path
        assert_names(content.decode(), "token", "whole address")
        assert token(server).encode() not in content


def test_without_the_token_no_websocket_is_opened(server: PageServer) -> None:
    base = f"http://{HOST}:{server.port}"
    for path in wrong_paths(token(server)):
        with pytest.raises(InvalidStatus) as refusal:
            FakeBrowser(base + path)
        assert refusal.value.response.status_code == 403


@pytest.mark.parametrize("host", ["", "localhost", "localhost:9000", "127.0.0.1:8080"])
def test_own_pages_and_programs_are_let_in_also_through_a_tunnel(server: PageServer, host: str) -> None:
    own = host or f"{HOST}:{server.port}"
    for origin in (None, f"http://{own}"):
        with FakeBrowser(server.url, origin=origin, host=host) as browser:
            browser.wait(lambda b=browser: b.node("/one"))


@pytest.mark.parametrize(
    "origin",
    [
        "https://example.com",
        "http://127.0.0.1.example.com",
        "http://example.com:8080",
        "null",
        "http://localhost:1.evil",
        "http://127.0.0.1:3000",
        "http://127.0.0.1",
        "http://localhost:{port}",
        "https://127.0.0.1:{port}",
    ],
)
def test_pages_of_other_sites_and_of_other_ports_are_refused_even_with_the_token(server, origin: str) -> None:
    origin = origin.format(port=server.port)
    with pytest.raises(InvalidStatus) as refusal:
        FakeBrowser(server.url, origin=origin)
    assert refusal.value.response.status_code == 403
    assert get(server, f"/{token(server)}", Origin=origin)[0] == 403


@pytest.mark.parametrize(
    "host", ["example.com", "robot.example.com:8080", "127.0.0.2", "127.0.0.1.example.com", "[::1]"]
)
def test_a_foreign_name_that_leads_here_opens_nothing(server: PageServer, host: str) -> None:
    """A name of a foreign site, made to point to this machine: to a browser, all of it is then one site."""
    with pytest.raises(InvalidStatus) as refusal:
        FakeBrowser(server.url, origin=f"http://{host}", host=host)
    assert refusal.value.response.status_code == 403
    assert get(server, f"/{token(server)}", Host=host)[0] == 403


def test_two_hosts_or_origins_are_refused(server: PageServer) -> None:
    own = f"{HOST}:{server.port}"
    for extra in (f"Host: {own}", f"Origin: http://{own}\r\nOrigin: http://{own}"):
        with socket.create_connection((HOST, server.port), timeout=60) as line:
            line.sendall(f"GET /{token(server)} HTTP/1.1\r\nHost: {own}\r\n{extra}\r\n\r\n".encode())
            assert line.recv(100).startswith(b"HTTP/1.1 403 ")


def test_every_answer_forbids_frames_and_referrers(server: PageServer) -> None:
    for path in (f"/{token(server)}", "/", f"/{token(server)}/absent"):
        _, _, headers = get(server, path)
        rules = (rule.split() for rule in headers["Content-Security-Policy"].split("; "))
        policy = {what: set(sources) for what, *sources in rules}
        assert policy["frame-ancestors"] == {"'none'"}
        own = {"'self'", "data:", "blob:"}
        assert policy["default-src"] == own  # nothing of other machines is loaded
        assert policy["script-src"] == {"'self'"}  # no evaluation, and no script in the page
        assert policy["connect-src"] == own | {"ws://127.0.0.1:*", "ws://localhost:*"}
        assert (headers["X-Frame-Options"], headers["Referrer-Policy"]) == ("DENY", "no-referrer")
        assert headers["Cache-Control"] == "no-store"


def test_tokens_are_compared_in_a_time_that_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the function that is made for it, and in no other way."""
    compared = []
    monkeypatch.setattr("tripod_view.gate.hmac.compare_digest", lambda a, b: compared.append((a, b)) or False)
    made = Gate()
    with pytest.raises(RefusedError):
        made.pass_on(f"/{made.token}", [HOST], [])
    assert compared == [(made.token.encode(), made.token.encode())]


def test_a_taken_port_gives_the_next_free_one(taken: int) -> None:
    made = page_server(taken)
    made.close()
    assert taken < made.port < taken + server_module.ATTEMPTS


def test_without_a_free_port_it_says_so_at_once(taken: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "ATTEMPTS", 1)
    with raises_naming(OSError, f"{taken} to {taken}", "in use"):
        page_server(taken)


def test_starting_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    page_server().close()
    assert capsys.readouterr().out == ""
