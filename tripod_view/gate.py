"""Who is let in to the page: whoever knows its address, and no web page of another site. Pure.

The address ends in a token that is drawn again each time. A browser sends it only where the page's own address was
opened, so that a web page of another site or of another port, framed or not, and another user of the machine, reach
neither the page nor its websocket; and a name that somebody else's server resolves to this machine opens nothing.
"""

import hmac
import re
import secrets
from collections.abc import Sequence
from typing import Final

TOKEN_BYTES: Final = 16
"""Of randomness in a token."""

OWN_HOST: Final = re.compile(r"(127\.0\.0\.1|localhost)(:\d{1,5})?")
"""Names that the page has, at any port: a tunnel to it may begin at another."""

POLICY: Final = (
    "default-src 'self' data: blob:; script-src 'self'; "
    "style-src 'self' 'unsafe-inline'; connect-src 'self' data: blob: ws://127.0.0.1:* ws://localhost:*; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; object-src 'none'"
)
"""What a browser lets the page load, and connect to: nothing of other machines."""

FILM_POLICY: Final = POLICY.replace("script-src 'self'", "script-src 'unsafe-inline'")
"""Of the page of a film, which has its scripts in itself."""

HEADERS: Final = {
    "Content-Security-Policy": POLICY,
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Sent with every answer: not to be framed, embedded, kept, or named to other sites."""


class RefusedError(Exception):
    """A request that is not let in; the message is what its sender is told."""


class Gate:
    """Lets in what knows the token.

    Attributes:
        token: What the path of the address begins with.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(TOKEN_BYTES)

    def pass_on(self, path: str, hosts: Sequence[str], origins: Sequence[str]) -> str:
        """Return the path that is meant behind the token.

        Args:
            path: What was asked for, with the token.
            hosts: All `Host` headers: the name by which the server was reached.
            origins: All `Origin` headers: the site of the web page that asks. Programs that are no browsers send none.

        Raises:
            RefusedError: another name than the page's own, another site, or no token or a wrong one.
        """
        if len(hosts) != 1 or not OWN_HOST.fullmatch(hosts[0]):
            raise RefusedError("this page is available at 127.0.0.1 only")
        if len(origins) > 1 or any(origin != f"http://{hosts[0]}" for origin in origins):
            raise RefusedError("pages of other sites may not use this page")
        given, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            raise RefusedError(
                "the address of this page ends in a token; open the whole address that was printed in the "
                "terminal"
            )
        return slash + rest or "/"
