"""A browser without a screen: speaks viser's protocol and that of the panel, and so may send what no page would."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

DEADLINE = 60.0  # [s], for a loaded machine


class FakeBrowser:
    """Keeps every message of viser, and the values that the panel shows."""

    def __init__(self, url: str, *, origin: str | None = None, host: str = "") -> None:
        """Open the page at `url`; `origin`, and `host` by which it is called: none, and that of the URL, by default."""
        protocol: Any = f"viser-v{viser.__version__}"
        _, _, own, path = url.split("/", 3)
        self._changed = threading.Condition()
        self.messages: list[dict[str, Any]] = []
        self.values: dict[str, Any] = {}
        self._socket, self._panel = (
            connect(
                f"ws://{host or own}/{end}",
                sock=socket.create_connection((own.split(":")[0], int(own.split(":")[1]))),
                origin=origin,
                subprotocols=protocols,
                max_size=None,
            )
            for end, protocols in ((path, [protocol]), (f"{path}/page/channel", None))
        )
        threading.Thread(target=self._receive, daemon=True).start()
        threading.Thread(target=self._receive_values, daemon=True).start()
        self.look_from(0.2, -0.2, 0.2)

    def __enter__(self) -> "FakeBrowser":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()
        self._panel.close()

    def freeze(self) -> None:
        """Take in nothing more and answer nothing, as a machine that lost its network."""
        for line in (self._socket, self._panel):
            line.protocol.receive_data = lambda data: None

    def send(self, kind: str, **fields: object) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def look_from(self, x: float, y: float, z: float) -> None:
        """Move the camera to a place [m]."""
        self.send(
            "ViewerCameraMessage",
            wxyz=(1, 0, 0, 0),
            position=(x, y, z),
            fov=0.7,
            near=0.01,
            far=10.0,
            image_height=600,
            image_width=800,
            look_at=(0, 0, 0),
            up_direction=(0, 0, 1),
        )

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
        self.send("TransformControlsDragStartMessage", name="/target_handle", owner="")

    def drag(self, x: object, y: object, z: object, wxyz: tuple[float, ...] = (1, 0, 0, 0)) -> None:
        self.send(
            "TransformControlsUpdateMessage",
            name="/target_handle",
            wxyz=wxyz,
            position=(x, y, z),
            owner="",
        )

    def drop(self) -> None:
        self.send("TransformControlsDragEndMessage", name="/target_handle", owner="")

    def of_kind(self, kind: str) -> list[dict[str, Any]]:
        with self._changed:
            return [m for m in self.messages if m["type"] == kind]

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
        updates = self.of_kind("SceneNodeUpdateMessage")
        return sum(m["name"] == "/bodies/0" and "vertices" in m["updates"] for m in updates)

    def position(self, name: str) -> list[float] | None:
        """Return where the page put a thing last [m]."""
        known = [m["position"] for m in self.of_kind("SetPositionMessage") if m["name"] == name]
        return list(known[-1]) if known else None

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
        decompressor = zstandard.ZstdDecompressor()
        with contextlib.suppress(ConnectionClosed):
            for raw in self._socket:
                assert isinstance(raw, bytes)
                size = int.from_bytes(raw[8:16], "little")
                window = msgspec.msgpack.decode(decompressor.decompress(raw[16 : 16 + size]))
                with self._changed:
                    self.messages.extend(window["messages"])
                    self._changed.notify_all()
