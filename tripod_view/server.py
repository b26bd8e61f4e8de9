"""The web server of the page: this machine only, nobody without its token, a known port."""

import asyncio
import gzip
import logging
import socket
import threading
from http import HTTPStatus
from typing import Final

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from tripod_view import channel as panel_channel
from tripod_view import stream as scene_stream
from tripod_view.channel import Channel
from tripod_view.gate import HEADERS, Gate, RefusedError
from tripod_view.pages import File, page_files
from tripod_view.stream import Stream

HOST: Final = "127.0.0.1"

ATTEMPTS: Final = 50
"""Ports tried from the one asked for upward."""

PING: Final = 1.0
"""Time between two questions to a browser whether it is there [s]: one in control that is not has lost control."""

PONG: Final = 2.0
"""Time for its answer [s]; the browser gives it by itself, also for a page that is not looked at."""

CLOSE_TIMEOUT: Final = 0.5
"""How long a browser that keeps its connection open can delay the end of the server [s]."""


class PageServer:
    """Serves the files of the page and its two websockets behind a `Gate`, in a thread of its own."""

    def __init__(self, port: int, channel: Channel, stream: Stream) -> None:
        """Listen on loopback at `port` or the next free one; 0: at any. Raises OSError if there is none.

        `stream` serves the 3-D scene, `channel` what is beside it.
        """
        log = logging.getLogger("tripod_view.websockets")
        log.setLevel(logging.CRITICAL)  # no tracebacks about bad requests
        self._gate, self._channel, self._stream = Gate(), channel, stream
        self._files = page_files(self._gate.token)
        line = listening(port)
        self._port = int(line.getsockname()[1])
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="page", daemon=True)
        self._thread.start()
        self._server = asyncio.run_coroutine_threadsafe(self._open(line, log), self._loop).result()

    @property
    def port(self) -> int:
        """The port on which it listens."""
        return self._port

    @property
    def url(self) -> str:
        """The address of the page, with its token: whoever has it may command the robot."""
        return f"http://{HOST}:{self._port}/{self._gate.token}"

    def close(self) -> None:
        """Stop serving; browsers show that the connection is lost."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._shut(), self._loop).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    async def _open(self, line: socket.socket, log: logging.Logger) -> Server:
        return await serve(
            self._handle,
            sock=line,
            logger=log,
            process_request=self._request,
            process_response=self._response,
            ping_interval=PING,
            ping_timeout=PONG,
            close_timeout=CLOSE_TIMEOUT,
            compression=None,  # this machine: the processor is the narrow place
        )

    async def _shut(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _handle(self, connection: ServerConnection) -> None:
        path = connection.request.path if connection.request else ""
        await (self._channel if path == panel_channel.PATH else self._stream).serve(connection)

    def _request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to a request, None to let a websocket open."""
        try:
            request.path = self._gate.pass_on(
                request.path, request.headers.get_all("Host"), request.headers.get_all("Origin")
            )
        except RefusedError as error:
            return connection.respond(HTTPStatus.FORBIDDEN, f"{error}\n")
        if request.headers.get("Upgrade", "").lower() == "websocket":
            if request.path in (panel_channel.PATH, scene_stream.PATH):
                return None
        elif file := self._files.get(request.path):
            return _answer(request, file)
        return connection.respond(HTTPStatus.NOT_FOUND, "there is only one page here\n")

    def _response(self, connection: ServerConnection, request: Request, response: Response) -> None:
        for name, value in HEADERS.items():
            response.headers[name] = value


def _answer(request: Request, file: File) -> Response:
    packs = "gzip" in request.headers.get("Accept-Encoding", "")
    body = file.packed if packs else gzip.decompress(file.packed)
    headers = Headers()
    headers["Content-Type"], headers["Content-Length"] = file.kind, str(len(body))
    headers["Content-Encoding"] = "gzip" if packs else "identity"
    return Response(HTTPStatus.OK, "OK", headers, body)


def listening(port: int) -> socket.socket:
    """Return a socket that listens at the first free port from `port` upward, at any for 0. Raises OSError."""
    error: OSError | None = None
    for candidate in range(port, min(port + ATTEMPTS, 65536)) if port else (0,):
        line = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # not blocked by TIME_WAIT
        try:
            line.bind((HOST, candidate))
            line.listen()
        except OSError as e:
            line.close()
            error = error or e
        else:
            return line
    raise OSError(
        f"no port from {port} to {candidate} can be opened: {error}; choose another with --set port=N"
    )
