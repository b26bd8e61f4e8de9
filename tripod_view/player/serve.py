"""The page of a film on this machine, also of one that is still being made. Standard library only."""

import json
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from tripod_view.gate import FILM_POLICY, HEADERS, Gate, RefusedError

HOST: Final = "127.0.0.1"

Answer = dict[str, Any]


class FilmServer:
    """Serves one film until it is closed; who does not know the token of its address sees nothing.

    Attributes:
        url: The address, with its token.
    """

    def __init__(self, page: Callable[[], str], reel: Callable[[int], Answer], port: int = 0) -> None:
        """Listen on loopback.

        Args:
            page: Returns the page; called for each browser, in a thread of its own.
            reel: Returns what the player is told of the pictures from one on: `reel` (None: there are none yet) and
                `done`; called likewise.
            port: Number of the port; 0 takes a free one.

        Raises:
            OSError: the port is taken, or there is none.
        """
        gate = Gate()

        class Handler(_Handler):
            answers = (gate, page, reel)

        self._server = ThreadingHTTPServer((HOST, port), Handler)
        self._server.daemon_threads = True
        self.url = f"http://{HOST}:{self._server.server_address[1]}/{gate.token}"
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()


class _Handler(BaseHTTPRequestHandler):
    """Answers one browser."""

    answers: tuple[Gate, Callable[[], str], Callable[[int], Answer]]
    protocol_version = "HTTP/1.1"
    timeout = 30

    def do_GET(self) -> None:
        """Answer with the page, or with pictures."""
        gate, page, reel = self.answers
        asked = urlsplit(self.path)
        try:
            path = gate.pass_on(
                asked.path, self.headers.get_all("Host") or [], self.headers.get_all("Origin") or []
            )
        except RefusedError as error:
            self._send(HTTPStatus.FORBIDDEN, "text/plain", f"{error}\n")
            return
        if path == "/":
            self._send(HTTPStatus.OK, "text/html", page())
        elif path == "/reel":
            first = parse_qs(asked.query).get("from", [""])[0]
            if not first.isdecimal() or len(first) > 9:
                self._send(HTTPStatus.BAD_REQUEST, "text/plain", "from must be the number of a picture\n")
            else:
                self._send(HTTPStatus.OK, "application/json", json.dumps(reel(int(first)), allow_nan=False))
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "there is only one page here\n")

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        body = text.encode()
        self.send_response(status)
        for name, value in (HEADERS | {"Content-Security-Policy": FILM_POLICY}).items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Say nothing: the path has the token."""
