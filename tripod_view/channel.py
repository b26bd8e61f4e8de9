"""What the page shows beside the 3-D scene, as values by name, and what people do there, as events: one websocket.

To a browser go JSON tables of the values that changed, all of them first; from it come JSON tables that
`events.event_of` understands. The values belong to the thread of ROS, the websockets to that of the page's server.
"""

import asyncio
import itertools
import json
from threading import Lock
from typing import Any, Final

from websockets.asyncio.server import ServerConnection, broadcast
from websockets.exceptions import ConnectionClosed

from tripod_view.events import LONGEST, EventError, Inbox, Joined, Left, Nonsense, event_of

PATH: Final = "/page/channel"
"""Of the websocket, behind the token."""


class Channel:
    """Shows values to all browsers and puts what they send into the inbox."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self._lock = Lock()
        self._shown: dict[str, str] = {}
        self._changed: set[str] = set()
        self._browsers: set[ServerConnection] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._numbers = itertools.count()

    def show(self, name: str, value: Any) -> None:
        """Show `value`, which JSON can hold, as `name` from the next `flush` on; nothing is sent if it is the same."""
        text = json.dumps(value, allow_nan=False)
        with self._lock:
            if self._shown.get(name) != text:
                self._shown[name] = text
                self._changed.add(name)

    def flush(self) -> None:
        """Send what changed since the last time."""
        with self._lock:
            text = self._table(sorted(self._changed))
            self._changed.clear()
            loop = self._loop
        if loop and text != "{}":
            loop.call_soon_threadsafe(self._send, text)

    def _table(self, names: list[str]) -> str:
        return "{" + ", ".join(f"{json.dumps(name)}: {self._shown[name]}" for name in names) + "}"

    def _send(self, text: str) -> None:
        broadcast(self._browsers, text)

    async def serve(self, connection: ServerConnection) -> None:
        """Serve one browser until it leaves; runs on the thread of the server."""
        number = next(self._numbers)
        with self._lock:
            self._loop = asyncio.get_running_loop()
            everything = self._table(sorted(self._shown))
        self._browsers.add(connection)
        self._inbox.put(Joined(number))
        try:
            await connection.send(everything)
            async for message in connection:
                self._take(number, message)
        except ConnectionClosed:
            pass
        finally:
            self._browsers.discard(connection)
            self._inbox.put(Left(number))

    def _take(self, number: int, message: str | bytes) -> None:
        try:
            if len(message) > LONGEST:
                raise EventError(f"a message has {len(message)} characters; allowed: at most {LONGEST}")
            self._inbox.put(event_of(message))
        except EventError as error:
            self._inbox.put(Nonsense(str(error)))
