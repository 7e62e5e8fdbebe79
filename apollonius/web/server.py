"""A server for one folder, for this machine alone."""

import os
import sys
from functools import partial
from http import HTTPStatus
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from apollonius.io.errors import InvalidInput
from apollonius.io.limits import PORT

LOOPBACK = "127.0.0.1"
FIRST_PORT = 8600
"""The first port that is tried."""
_PORTS = 50
"""Number of ports that are tried."""


class FolderHandler(SimpleHTTPRequestHandler):
    """A handler of requests for the files of a folder: no listings, no other hosts' names, no
    caching.
    """

    timeout = 20.0
    """Time that a connection may be silent [s]."""
    extensions_map = SimpleHTTPRequestHandler.extensions_map | {
        ".js": "text/javascript",
        ".svg": "image/svg+xml",
    }

    def send_head(self) -> Any:
        """Refuse requests that are meant for another host (DNS rebinding) or that name no file."""
        port = self.server.server_port  # pyright: ignore[reportAttributeAccessIssue]
        if self.headers.get("Host") not in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
            self.send_error(
                HTTPStatus.MISDIRECTED_REQUEST, "This server answers to its own name only"
            )
            return None
        try:
            return super().send_head()
        except ValueError:  # a path with a zero byte
            self.send_error(HTTPStatus.NOT_FOUND)
            return None

    def list_directory(self, path: Any) -> None:
        self.send_error(HTTPStatus.NOT_FOUND)

    def end_headers(self) -> None:
        """Forbid scripts of other hosts, guessed types and caching."""
        policy = (
            "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; frame-ancestors 'none'; "
            "base-uri 'none'"
        )
        self.send_header("Content-Security-Policy", policy)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""


def make_server(folder: Path, port: int | None = None) -> ThreadingHTTPServer:
    """Return a server of a folder, and nothing above it, on the loopback address, ready for
    `serve_forever`; raises InvalidInput when the port cannot be used.

    Args:
        port: to listen on; None takes the first free one from `FIRST_PORT` on.
    """
    if port is not None:
        PORT.require("port", port)
    reason: str | None = ""
    for candidate in range(FIRST_PORT, FIRST_PORT + _PORTS) if port is None else (port,):
        try:
            return _Server((LOOPBACK, candidate), partial(FolderHandler, directory=str(folder)))
        except OSError as error:
            port, reason = candidate, error.strerror
    raise InvalidInput(f"port = {port} cannot be used ({reason}): choose another, or leave it out.")


class _Server(ThreadingHTTPServer):
    """A server that fails on a port in use; on Windows, reuse would let both listen."""

    allow_reuse_address = os.name == "posix"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing when the connection was closed."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)
