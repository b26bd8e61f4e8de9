"""The drawing as it goes to browsers, one websocket each: the newest state, as fast as the browser takes it.

A browser confirms each picture when it draws. At most `AHEAD` are under way; one that is slow or hidden gets the newest
state when it is ready again, and delays nobody. From it come confirmations and what a hand does to the target.
"""

import asyncio
import contextlib
import itertools
from threading import Lock
from typing import Final

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from tripod_view.drawing import Drawing
from tripod_view.events import LONGEST, Dropped, EventError, Inbox, Nonsense, Shows, Took, hand_of

PATH: Final = "/page/scene"
"""Of the websocket, behind the token."""

AHEAD: Final = 2
"""Pictures under way to a browser: one would halve their rate over a slow line."""


class Viewer:
    """One browser: how many pictures it was sent and took."""

    def __init__(self) -> None:
        self.ready, self.sent, self.taken = asyncio.Event(), 0, 0


class Stream:
    """Sends the drawing to all browsers and puts what hands do into the inbox."""

    def __init__(self, drawing: Drawing, inbox: Inbox) -> None:
        self._drawing, self._inbox, self._lock = drawing, inbox, Lock()
        self._viewers: set[Viewer] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._numbers = itertools.count()

    def flush(self) -> None:
        """Send what changed, as soon as each browser is ready; any thread."""
        with self._lock:
            loop = self._loop if self._viewers else None
        if loop:
            with contextlib.suppress(RuntimeError):  # the server has just been stopped
                loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for viewer in self._viewers:
            viewer.ready.set()

    async def serve(self, connection: ServerConnection) -> None:
        """Serve one browser until it leaves; runs on the thread of the server."""
        number, viewer = next(self._numbers), Viewer()
        with self._lock:
            self._loop = asyncio.get_running_loop()
            self._viewers.add(viewer)
        sender = asyncio.create_task(self._send(connection, viewer))
        try:
            async for message in connection:
                self._take(number, viewer, message)
        except ConnectionClosed:
            pass
        finally:
            sender.cancel()
            with self._lock:
                self._viewers.discard(viewer)
            self._inbox.put(Dropped(number))
            self._inbox.put(Shows(number, "", forces=False))

    async def _send(self, connection: ServerConnection, viewer: Viewer) -> None:
        seen = 0
        with contextlib.suppress(ConnectionClosed):
            while True:
                viewer.ready.clear()
                if viewer.sent - viewer.taken < AHEAD:
                    message, seen = self._drawing.changes(seen)
                    if message:
                        viewer.sent += 1
                        await connection.send(message)
                await viewer.ready.wait()

    def _take(self, number: int, viewer: Viewer, message: str | bytes) -> None:
        try:
            if len(message) > LONGEST:
                raise EventError(f"a message has {len(message)} characters; allowed: at most {LONGEST}")
            event = hand_of(message, number)
        except EventError as error:
            self._inbox.put(Nonsense(str(error)))
            return
        if isinstance(event, Took):
            viewer.taken = min(viewer.taken + 1, viewer.sent)
            viewer.ready.set()
        else:
            self._inbox.put(event)
