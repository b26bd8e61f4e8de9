"""The web server of the page: this machine only, no public tunnel, no foreign web sites, a known port."""

import contextlib
import functools
import io
import logging
import re
import socket
from typing import Any, Final

import viser
import websockets.asyncio.server as websocket_server

HOST: Final = "127.0.0.1"

OWN_ORIGIN: Final = re.compile(r"http://(127\.0\.0\.1|localhost)(:\d{1,5})?")
"""Pages that may talk to the robot. A browser names the page's site in every handshake; without this rule any
web site open in it could move the robot, because browsers let every site reach servers on the own machine.
Programs that are not browsers send no origin and are let in: they could talk to ROS as well."""

ATTEMPTS: Final = 50
"""Ports tried from the one asked for upward."""

CLOSE_TIMEOUT: Final = 0.5
"""How long a browser that keeps its connection open can delay the end of the server [s]."""


class PageServer(viser.ViserServer):
    """A viser server that cannot be published and prints nothing.

    Any client of viser may ask the server to open a public tunnel; here that request does nothing.
    """

    def __init__(self, port: int) -> None:
        """Listen on loopback at `port` or the next free one; 0: at any. Raises OSError if there is none."""
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)  # no tracebacks about bad requests
        start = functools.partial(
            websocket_server.serve, origins=[None, OWN_ORIGIN], close_timeout=CLOSE_TIMEOUT
        )
        with _replaced(websocket_server, "serve", start), contextlib.redirect_stdout(io.StringIO()):
            super().__init__(host=HOST, port=free_port(port), label="Tripod", verbose=False)

    def request_share_url(self, verbose: bool = True) -> None:
        """Do nothing: the page is never published."""

    def close(self) -> None:
        """Stop serving; browsers show that the connection is lost."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.stop()


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
    raise OSError(f"no port from {port} to {candidate} can be listened on: {error}")


@contextlib.contextmanager
def _replaced(module: Any, name: str, value: Any) -> Any:
    """Replace an attribute of a module for a while: viser does not pass these settings on."""
    original = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, original)
