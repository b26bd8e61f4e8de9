"""A browser without a screen: speaks the protocols of scene and panel, and so may send what no page would."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tripod_view.drawing import NUMBERS

DEADLINE = 60.0  # [s], for a loaded machine
FLAT = ("values", "points", "vectors")


class FakeBrowser:
    """Keeps every message of the scene, the nodes as they are now, and the values that the panel shows."""

    def __init__(self, url: str, *, origin: str | None = None, host: str = "", takes: bool = True) -> None:
        """Open the page at `url`; `origin`, and `host` by which it is called: none, and that of the URL, by default.

        `takes`: whether it confirms pictures.
        """
        _, _, own, path = url.split("/", 3)
        self._changed = threading.Condition()
        self.takes = takes
        self.messages: list[dict[str, Any]] = []
        self.nodes: dict[int, dict[str, Any]] = {}
        self.values: dict[str, Any] = {}
        self._scene, self._panel = (
            connect(
                f"ws://{host or own}/{path}/page/{end}",
                sock=socket.create_connection((own.split(":")[0], int(own.split(":")[1]))),
                origin=origin,
                max_size=None,
            )
            for end in ("scene", "channel")
        )
        threading.Thread(target=self._receive, daemon=True).start()
        threading.Thread(target=self._receive_values, daemon=True).start()

    def __enter__(self) -> "FakeBrowser":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._scene.close()
        self._panel.close()

    def freeze(self) -> None:
        """Take in nothing more and answer nothing, as a machine that lost its network."""
        for line in (self._scene, self._panel):
            line.protocol.receive_data = lambda data: None

    def send(self, **event: object) -> None:
        """Send an event of the scene."""
        self._scene.send(json.dumps(event))

    def tell(self, **event: object) -> None:
        """Send an event of the panel."""
        self.tell_raw(json.dumps(event))

    def tell_raw(self, text: str) -> None:
        """Send a message on the panel's channel, whatever it is."""
        self._panel.send(text)

    def press(self, button: str) -> None:
        """Press a button by its name in `events.Button`."""
        self.tell(press=button)

    def slide(self, servo: int, degrees: object) -> None:
        """Put the slider of `servo` at `degrees`."""
        self.tell(servo=servo, degrees=degrees)

    def shown(self, servo: int) -> float:
        """Return where the page shows the slider of `servo` [degrees]."""
        return self.value("joints")["asked"][servo]

    def value(self, name: str) -> Any:
        """Return what the panel shows as `name`, None before it does."""
        with self._changed:
            return self.values.get(name)

    def grab(self) -> None:
        self.send(grab=True)

    def drag(self, x: object, y: object, z: object, turn: tuple[float, ...] = (0, 0, 0, 1)) -> None:
        self.send(drag=(x, y, z), turn=turn)

    def drop(self) -> None:
        self.send(drop=True)

    def changes(self, path: str, name: str = "kind") -> list[Any]:
        """Return the values that a property of what is at `path` has had; `kind`: one for each time it was added."""
        with self._changed:
            nodes = [node for message in self.messages for node in message.get("nodes", ())]
        return [node[name] for node in nodes if node["path"] == path and name in node["changed"]]

    def node(self, path: str) -> dict[str, Any] | None:
        """Return the properties of what is at `path` now."""
        with self._changed:
            return next((dict(node) for node in self.nodes.values() if node["path"] == path), None)

    def cameras(self, *, fit: bool) -> list[dict[str, Any]]:
        """Return how the camera was aimed: in any case, or where nobody has moved it."""
        with self._changed:
            return [m["camera"] for m in self.messages if "camera" in m and m["camera"]["fit"] == fit]

    def text(self) -> str:
        """Return all that the panel shows now."""
        with self._changed:
            lines = [
                v
                for values in self.values.values()
                for v in (values if isinstance(values, list) else [values])
            ]
        return "\n".join(
            f"{line['who']} {line['text']}" for line in lines if isinstance(line, dict) and "who" in line
        )

    def pictures(self) -> int:
        """Return how often the vertices of the body were sent."""
        return len(self.changes("/bodies/0", "vertices"))

    def position(self, path: str) -> list[float] | None:
        """Return where a thing is [m]."""
        found = self.node(path)
        return list(found["pose"][:3]) if found else None

    def wait(self, what: Callable[[], object]) -> Any:
        """Return `what()` as soon as it is true after a message, or fail after DEADLINE."""
        until = time.monotonic() + DEADLINE
        with self._changed:
            while not (found := what()):
                assert time.monotonic() < until, self.text()
                self._changed.wait(0.1)
        return found

    def _receive_values(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for text in self._panel:
                with self._changed:
                    self.values |= json.loads(text)
                    self._changed.notify_all()

    def _receive(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for raw in self._scene:
                assert isinstance(raw, bytes)
                with self._changed:
                    self._take(raw)
                    self._changed.notify_all()
                if self.takes:
                    self.send(took=True)

    def _take(self, raw: bytes) -> None:
        first = 4 + int.from_bytes(raw[:4], "little")
        message = json.loads(raw[4:first])
        if "alive" in message:
            self.nodes = {number: self.nodes[number] for number in message["alive"] if number in self.nodes}
        for i, entry in enumerate(message.get("nodes", ())):
            for name in NUMBERS.keys() & entry:
                kind = np.dtype(NUMBERS[name]).newbyteorder("<")
                at, count = entry[name]
                found = np.frombuffer(raw, kind, count, first + at)
                entry[name] = found if name in FLAT else found.reshape(-1, 3)
            known = self.nodes.setdefault(entry["number"], {})
            known |= entry
            message["nodes"][i] = {**known, "changed": set(entry)}
        self.messages.append(message)
