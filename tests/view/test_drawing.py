"""What of the drawing goes to a browser: all of it first, then what changed, and never more than it takes."""

import json
import socket
import threading
import time
import tracemalloc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("websockets")

from websockets.sync.client import connect

from tests.bringup.processes import wait_until
from tests.messages import assert_names
from tests.view.fake_browser import FakeBrowser
from tripod_view.channel import Channel
from tripod_view.drawing import Aim, Drawing
from tripod_view.events import Dragged, Dropped, Grabbed, Inbox, Nonsense
from tripod_view.pose import Pose
from tripod_view.server import HOST, PageServer
from tripod_view.stream import AHEAD, Stream

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
TRIANGLE = np.array([[0, 1, 2]])
PINK = (255, 0, 128)


def head(message: bytes) -> dict[str, Any]:
    size = int.from_bytes(message[:4], "little")
    assert (4 + size) % 4 == 0
    return json.loads(message[4 : 4 + size])


def test_a_browser_gets_all_first_and_then_what_changed() -> None:
    drawing = Drawing()
    frame = drawing.add("/a", "group", axes=0.0)
    mesh = drawing.mesh("/a/b", CORNERS, TRIANGLE, PINK)
    message, seen = drawing.changes(0)
    first, second = head(message)["nodes"]
    assert (first["path"], first["parent"], second["parent"]) == ("/a", 0, first["number"])
    arrays = message[4 + int.from_bytes(message[:4], "little") :]
    vertices, triangles = (np.frombuffer(arrays, k, second[n][1], second[n][0])
                           for n, k in (("vertices", "<f4"), ("triangles", "<u4")))  # fmt: skip
    assert vertices.reshape(-1, 3).tolist() == CORNERS.tolist()
    assert triangles.reshape(-1, 3).tolist() == TRIANGLE.tolist()
    assert drawing.changes(seen)[0] == b""
    frame.place(Pose.of((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0)))
    frame.place(Pose.of((1.0, 2.0, 4.0), (0.0, 0.0, 0.0, 1.0)))
    frame.visible, mesh.visible = False, True  # the second as it was
    message, newer = drawing.changes(seen)
    assert head(message) == {"nodes": [{"number": 1, "visible": False, "pose": [1, 2, 4, 0, 0, 0, 1]}]}
    assert drawing.changes(newer)[0] == b""
    assert len(head(drawing.changes(0)[0])["nodes"]) == 2


def test_what_is_removed_goes_with_what_moved_with_it_and_may_come_again() -> None:
    drawing = Drawing()
    frame = drawing.add("/a", "group", axes=0.0)
    child = drawing.mesh("/a/b", CORNERS, TRIANGLE, PINK)
    drawing.add("/ab", "group", axes=0.0)
    _, seen = drawing.changes(0)
    frame.remove()
    message, seen = drawing.changes(seen)
    child.remove()  # is gone already
    assert head(message) == {"alive": [3]}
    again = drawing.add("/a", "group", axes=0.0)
    assert again.number == 4
    drawing.add("/a", "group", axes=1.0)
    message, _ = drawing.changes(seen)
    assert (head(message)["alive"], [n["number"] for n in head(message)["nodes"]]) == ([3, 5], [5])
    again.remove()  # is another one's now
    assert len(head(drawing.changes(0)[0])["nodes"]) == 2


def test_a_camera_is_taken_in_any_case_by_who_has_not_seen_its_last_fit() -> None:
    drawing = Drawing()
    near, far = (Aim((0.0, 0.0, 0.0), radius, 0.0, 0.0, 0.0) for radius in (1.0, 2.0))
    drawing.aim(near, fit=True)
    message, seen = drawing.changes(0)
    assert head(message)["camera"]["fit"]
    drawing.aim(far, fit=False)
    assert head(drawing.changes(seen)[0])["camera"] == {**vars(far), "centre": [0, 0, 0], "fit": False}
    assert head(drawing.changes(0)[0])["camera"]["fit"]


def test_nobody_gets_half_a_picture() -> None:
    drawing = Drawing()
    one, other = (drawing.add(f"/{i}", "label", text="") for i in range(2))
    reader = threading.Thread(target=lambda: read.append(drawing.changes(0)[0]))
    read: list[bytes] = []
    with drawing.picture():
        one.set("text", "new")
        reader.start()
        reader.join(0.05)
        other.set("text", "new")
    reader.join()
    assert [node["text"] for node in head(read[0])["nodes"]] == ["new", "new"]


class Page:
    """A server of a drawing that moves a mesh whenever it is asked to."""

    def __init__(self, count: int) -> None:
        self.inbox = Inbox(lambda: None)
        self.drawing = Drawing()
        self.stream = Stream(self.drawing, self.inbox)
        self.mesh = self.drawing.mesh("/bodies/0", np.zeros((count, 3)), TRIANGLE, PINK, deforms=True)
        self.channel = Channel(self.inbox)
        self.server = PageServer(0, self.channel, self.stream)
        self.count, self.drawn = count, 0

    def draw(self) -> int:
        """Draw a picture whose vertices are at its number; return it."""
        self.drawn += 1
        with self.drawing.picture():
            self.mesh.set("vertices", np.full((self.count, 3), float(self.drawn)))
        self.stream.flush()
        return self.drawn


@pytest.fixture
def page() -> Iterator[Page]:
    made = Page(3000)
    yield made
    made.server.close()


def newest(browser: FakeBrowser) -> float:
    return float(browser.changes("/bodies/0", "vertices")[-1][0, 0])


def test_a_browser_that_is_slow_gets_the_newest_picture_and_delays_no_other(page: Page) -> None:
    with FakeBrowser(page.server.url) as quick, FakeBrowser(page.server.url, takes=False) as slow:
        for browser in (quick, slow):
            browser.wait(browser.pictures)
        for _ in range(30):
            last = page.draw()
            quick.wait(lambda last=last: newest(quick) == last)
        assert slow.pictures() == AHEAD
        slow.send(took=True)
        slow.wait(lambda: newest(slow) == last)
        assert slow.pictures() == AHEAD + 1


def test_who_reads_nothing_fills_no_queue(page: Page) -> None:
    port = page.server.port
    with socket.socket() as line, FakeBrowser(page.server.url) as quick:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        line.connect((HOST, port))
        path = page.server.url.split("/", 3)[3] + "/page/scene"
        line.sendall(
            f"GET /{path} HTTP/1.1\r\nHost: {HOST}:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        quick.wait(lambda: len(page.stream._viewers) == 2)
        for _ in range(40):
            last = page.draw()
            quick.wait(lambda last=last: newest(quick) == last)
        assert max(viewer.sent - viewer.taken for viewer in page.stream._viewers) <= AHEAD


def test_who_sleeps_fills_no_memory_and_wakes_up_in_the_present(page: Page) -> None:
    """Nothing is read of both websockets while 36 MB of tables and 12 MB of pictures are shown: those of an hour."""
    base = page.server.url.replace("http", "ws", 1)
    count, big = 4000, "x" * 9000
    with (
        connect(f"{base}/page/channel", max_queue=1) as panel,
        connect(f"{base}/page/scene", max_queue=1, max_size=None) as scene,
    ):
        assert wait_until(lambda: page.stream._viewers and page.channel._browsers)
        tracemalloc.start()
        for number in range(count):
            page.channel.show("number", [number, big])
            page.channel.flush()
            if number % 12 == 0:
                page.draw()
        last = page.draw()
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert most < 20e6  # [bytes]; all tables are 36 MB
        numbers = []
        while not numbers or numbers[-1] < count - 1:
            numbers += [value[0] for value in (json.loads(panel.recv(60)).get("number"),) if value]
        assert numbers == sorted(numbers)
        assert len(numbers) < count / 3, "what came meanwhile is not made up for"
        for _ in range(AHEAD + 1):  # those on their way, then the present
            message = scene.recv(60)
            scene.send(json.dumps({"took": True}))
        size = int.from_bytes(message[:4], "little")
        entry = next(node for node in head(message)["nodes"] if "vertices" in node)
        assert np.frombuffer(message, "<f4", 1, 4 + size + entry["vertices"][0]) == last


def test_hands_are_told_from_nonsense(page: Page) -> None:
    with FakeBrowser(page.server.url) as browser:
        browser.grab()
        browser.drag(0.1, 0.2, 0.3)
        for bad in ({"drag": 3, "turn": [0, 0, 0, 1]}, {"press": "STOP"}, {"took": "x" * 2000}):
            browser.send(**bad)
        browser.drop()
        events: list[Any] = []
        browser.wait(lambda: events.extend(page.inbox.drain()) or any(isinstance(e, Dropped) for e in events))
    kinds = [event for event in events if isinstance(event, Grabbed | Dragged | Dropped | Nonsense)]
    assert kinds[:2] == [Grabbed(0), Dragged(0, [0.1, 0.2, 0.3], [0, 0, 0, 1])]
    assert [type(event) for event in kinds[2:]] == [Nonsense] * 3 + [Dropped]
    for event, named in zip(kinds[2:5], (("drag",), ("press",), ("characters", 1000)), strict=True):
        assert_names(event.what, *named)


def test_a_browser_that_leaves_lets_go(page: Page) -> None:
    with FakeBrowser(page.server.url) as browser:
        browser.wait(browser.pictures)
    until = time.monotonic() + 60
    events: list[Any] = []
    while not any(isinstance(event, Dropped) for event in events):
        assert time.monotonic() < until
        events.extend(page.inbox.drain())
        time.sleep(0.01)
