"""The web server of the page: this machine only, no public tunnel, nobody without its token, a known port."""

import contextlib
import functools
import gzip
import io
import logging
import socket
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any, Final

import viser
import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from tripod_view.channel import PATH, Channel
from tripod_view.gate import HEADERS, Gate, RefusedError
from tripod_view.pages import File, page_files

HOST: Final = "127.0.0.1"

ATTEMPTS: Final = 50
"""Ports tried from the one asked for upward."""

PING: Final = 1.0
"""Time between two questions to a browser whether it is there [s]: one in control that is not has lost control."""

PONG: Final = 2.0
"""Time for its answer [s]; the browser gives it by itself, also for a page that is not looked at."""

CLOSE_TIMEOUT: Final = 0.5
"""How long a browser that keeps its connection open can delay the end of the server [s]."""


class PageServer(viser.ViserServer):
    """A viser server behind a `Gate`, that cannot be published and prints nothing.

    Any client of viser may ask the server to open a public tunnel; here that request does nothing.
    """

    def __init__(self, port: int, channel: Channel) -> None:
        """Listen on loopback at `port` or the next free one; 0: at any. Raises OSError if there is none.

        `channel` serves what is beside the 3-D scene.
        """
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # no tracebacks about bad requests
        self._gate = Gate()
        start = functools.partial(_serve, websocket_server.serve, self._gate, channel)
        with _replaced(websocket_server, "serve", start), contextlib.redirect_stdout(io.StringIO()):
            super().__init__(host=HOST, port=free_port(port), label="Tripod", verbose=False)

    @property
    def url(self) -> str:
        """The address of the page, with its token: whoever has it may command the robot."""
        return f"http://{HOST}:{self.get_port()}/{self._gate.token}"

    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing: the page is never published."""

    def close(self) -> None:
        """Stop serving; browsers show that the connection is lost."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.stop()


def _serve(
    serve: Callable[..., Any],
    gate: Gate,
    channel: Channel,
    handler: Callable[[ServerConnection], Awaitable[None]],
    *arguments: Any,
    process_request: Callable[[ServerConnection, Request], Response | None],
    **options: Any,
) -> Any:
    """Call `serve` of the websockets library as viser does, with `gate` before its websocket and our page."""
    files = page_files(gate.token)

    def request(connection: ServerConnection, request: Request) -> Response | None:
        try:
            request.path = gate.pass_on(
                request.path, request.headers.get_all("Host"), request.headers.get_all("Origin")
            )
        except RefusedError as error:
            return connection.respond(HTTPStatus.FORBIDDEN, f"{error}\n")
        if request.headers.get("Upgrade") != "websocket" and (file := files.get(request.path)):
            return _answer(request, file)
        return process_request(connection, request)

    async def handle(connection: ServerConnection) -> None:
        path = connection.request.path if connection.request else ""
        await (channel.serve(connection) if path == PATH else handler(connection))

    def response(connection: ServerConnection, request: Request, response: Response) -> None:
        for name, value in HEADERS.items():
            response.headers[name] = value

    options |= {
        "ping_interval": PING,
        "ping_timeout": PONG,
        "close_timeout": CLOSE_TIMEOUT,
        "process_request": request,
        "process_response": response,
    }
    return serve(handle, *arguments, **options)


def _answer(request: Request, file: File) -> Response:
    packs = "gzip" in request.headers.get("Accept-Encoding", "")
    body = file.packed if packs else gzip.decompress(file.packed)
    headers = Headers()
    headers["Content-Type"], headers["Content-Length"] = file.kind, str(len(body))
    headers["Content-Encoding"] = "gzip" if packs else "identity"
    return Response(HTTPStatus.OK, "OK", headers, body)


def free_port(port: int) -> int:
    """Return the first port from `port` upward on which one can listen, 0 for 0.

    viser would look by itself, without saying so, and without end where none can be had. Raises OSError.
    """
    if port == 0:
        return 0
    error: OSError | None = None
    for candidate in range(port, min(port + ATTEMPTS, 65536)):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(
                socket.SOL_SOCKET, socket.SO_REUSEADDR, 1
            )  # as the server does: not blocked by TIME_WAIT
            try:
                probe.bind((HOST, candidate))
                probe.listen(1)
            except OSError as e:
                error = error or e
            else:
                return candidate
    raise OSError(
        f"no port from {port} to {candidate} can be opened: {error}; choose another with --set port=N"
    )


@contextlib.contextmanager
def _replaced(module: Any, name: str, value: Any) -> Any:
    """Replace an attribute of a module for a while: viser does not pass these settings on."""
    original = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, original)
