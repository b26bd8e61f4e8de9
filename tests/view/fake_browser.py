"""A browser without a screen: speaks viser's websocket protocol, and so may send what no page would."""

import contextlib
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
    """Keeps every message of the page; finds controls by their label."""

    def __init__(self, url: str, *, origin: str | None = None, host: str = "") -> None:
        """Open the page at `url`; `origin`, and `host` by which it is called: none, and that of the URL, by default."""
        protocol: Any = f"viser-v{viser.__version__}"
        _, _, own, path = url.split("/", 3)
        self._socket = connect(
            f"ws://{host or own}/{path}",
            sock=socket.create_connection((own.split(":")[0], int(own.split(":")[1]))),
            origin=origin,
            subprotocols=[protocol],
            max_size=None,
        )
        self._changed = threading.Condition()
        self.messages: list[dict[str, Any]] = []
        threading.Thread(target=self._receive, daemon=True).start()
        self.send(
            "ViewerCameraMessage",
            wxyz=(1, 0, 0, 0),
            position=(0.2, -0.2, 0.2),
            fov=0.7,
            near=0.01,
            far=10.0,
            image_height=600,
            image_width=800,
            look_at=(0, 0, 0),
            up_direction=(0, 0, 1),
        )

    def __enter__(self) -> "FakeBrowser":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()

    def freeze(self) -> None:
        """Take in nothing more and answer nothing, as a machine that lost its network."""
        self._socket.protocol.receive_data = lambda data: None

    def send(self, kind: str, **fields: object) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def press(self, label: str) -> None:
        """Press the button with `label`, alone or in a group."""
        for kind, value in (("GuiButtonMessage", True), ("GuiButtonGroupMessage", label)):
            for m in self.of_kind(kind):
                if label in (m["props"]["label"], *m["props"].get("options", ())):
                    self.send("GuiUpdateMessage", uuid=m["uuid"], updates={"value": value})
                    return
        raise AssertionError(f"no button {label!r}")

    def slide(self, servo: int, degrees: object) -> None:
        """Put the slider of `servo` at `degrees`."""
        self.send("GuiUpdateMessage", uuid=self.slider(servo), updates={"value": degrees})

    def slider(self, servo: int) -> str:
        return self.of_kind("GuiSliderMessage")[servo]["uuid"]

    def shown(self, servo: int) -> float:
        """Return what the page put the slider of `servo` at last [degrees]."""
        uuid = self.slider(servo)
        updates = [m["updates"] for m in self.of_kind("GuiUpdateMessage") if m["uuid"] == uuid]
        return next((u["value"] for u in reversed(updates) if "value" in u), 0.0)

    def grab(self) -> None:
        self.send("TransformControlsDragStartMessage", name="/target_handle", owner="")

    def drag(self, x: object, y: object, z: object) -> None:
        self.send(
            "TransformControlsUpdateMessage",
            name="/target_handle",
            wxyz=(1, 0, 0, 0),
            position=(x, y, z),
            owner="",
        )

    def drop(self) -> None:
        self.send("TransformControlsDragEndMessage", name="/target_handle", owner="")

    def of_kind(self, kind: str) -> list[dict[str, Any]]:
        with self._changed:
            return [m for m in self.messages if m["type"] == kind]

    def text(self) -> str:
        """Return all text on the page now, as HTML."""
        shown = {m["uuid"]: m["props"]["content"] for m in self.of_kind("GuiHtmlMessage")}
        for m in self.of_kind("GuiUpdateMessage"):
            if "content" in m["updates"]:
                shown[m["uuid"]] = m["updates"]["content"]
        return "\n".join(shown.values())

    def pictures(self) -> int:
        """Return how often the vertices of the silicone were sent."""
        updates = self.of_kind("SceneNodeUpdateMessage")
        return sum(m["name"] == "/silicone" and "vertices" in m["updates"] for m in updates)

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
