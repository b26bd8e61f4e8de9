"""What the page shows beside the 3-D scene, as values by name, and what people do there, as events: one websocket.

To a browser go JSON tables of the values that changed, all of them first, as fast as it takes them: one that sleeps
gets the newest values when it wakes up. From it come JSON tables that `events.event_of` understands. The values belong
to the thread of ROS, the websockets to that of the page's server.
"""

import asyncio
import contextlib
import itertools
import json
from collections.abc import Iterable
from threading import Lock
from typing import Any, Final

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from tripod_view.events import LONGEST, EventError, Inbox, Joined, Left, Nonsense, event_of

PATH: Final = "/page/channel"
"""Of the websocket, behind the token."""


class _Browser:
    """One browser: the names of the values that it has not been sent."""

    def __init__(self, names: Iterable[str]) -> None:
        self.ready, self.waiting = asyncio.Event(), set(names)


class Channel:
    """Shows values to all browsers and puts what they send into the inbox."""

    def __init__(self, inbox: Inbox) -> None:
        self._inbox = inbox
        self._lock = Lock()
        self._shown: dict[str, str] = {}
        self._changed: set[str] = set()
        self._browsers: set[_Browser] = set()
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
        """Send what changed since the last time, as soon as each browser is ready."""
        with self._lock:
            for browser in self._browsers:
                browser.waiting |= self._changed
            loop = self._loop if self._changed else None
            self._changed.clear()
        if loop:
            loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for browser in self._browsers:
            browser.ready.set()

    def _take_waiting(self, browser: _Browser) -> str:
        """Return the newest of the values for which a browser waits, as JSON."""
        with self._lock:
            names = sorted(browser.waiting)
            browser.waiting.clear()
            return "{" + ", ".join(f"{json.dumps(name)}: {self._shown[name]}" for name in names) + "}"

    async def _send(self, connection: ServerConnection, browser: _Browser) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                browser.ready.clear()
                if browser.waiting:
                    await connection.send(self._take_waiting(browser))
                await browser.ready.wait()

    async def serve(self, connection: ServerConnection) -> None:
        """Serve one browser until it leaves; runs on the thread of the server."""
        number = next(self._numbers)
        with self._lock:
            self._loop = asyncio.get_running_loop()
            browser = _Browser(self._shown)
            self._browsers.add(browser)
        self._inbox.put(Joined(number))
        sender = asyncio.create_task(self._send(connection, browser))
        try:
            async for message in connection:
                self._take(number, message)
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()
            with self._lock:
                self._browsers.discard(browser)
            self._inbox.put(Left(number))

    def _take(self, number: int, message: str | bytes) -> None:
        try:
            if len(message) > LONGEST:
                raise EventError(f"a message has {len(message)} characters; allowed: at most {LONGEST}")
            self._inbox.put(event_of(message))
        except EventError as error:
            self._inbox.put(Nonsense(str(error)))
