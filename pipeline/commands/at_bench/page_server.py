"""A page served to this machine alone: one address, one page, no other host's questions."""

from __future__ import annotations

import os
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from threading import Thread
from typing import TYPE_CHECKING

from pmg.pipeline.commands.at_bench.page_frame import POLICY
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Iterator

HOST = "127.0.0.1"
"""The only address that is listened on."""


@dataclass
class ServedPage:
    """A page that is served, and may be replaced at any time.

    Parameters
    ----------
    html : str
        The page.
    port : int
        Where it is served.
    """

    html: str
    port: int = 0

    @property
    def address(self) -> str:
        """Address of the page on this machine."""
        return f"http://{HOST}:{self.port}/"


class _LoopbackServer(ThreadingHTTPServer):
    """A server that takes no port in use from another program, and looks up no name."""

    allow_reuse_address = os.name == "posix"  # elsewhere it would share a port that is taken

    def server_bind(self) -> None:
        """Bind without asking for the name of this machine, as `http.server` does."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = HOST, self.server_address[1]


@contextmanager
def serving(page: ServedPage) -> Iterator[ServedPage]:
    """Serve a page on this machine until the block is left.

    A request must name this machine as its host: a page from elsewhere that makes a browser ask here under a name of
    its own (DNS rebinding) is refused. Nothing but the page is served.

    Parameters
    ----------
    page : ServedPage
        The page; port 0 takes any that is free.

    Raises
    ------
    StoreError
        The port is taken.
    """

    class PageAnswer(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            hosts = {f"{name}:{page.port}" for name in (HOST, "localhost")}
            if self.headers.get("Host", "") not in hosts:
                return self._send(HTTPStatus.MISDIRECTED_REQUEST, "This page is for this machine alone.")
            if self.path != "/":
                return self._send(HTTPStatus.NOT_FOUND, "There is one page, at /.")
            return self._send(HTTPStatus.OK, page.html, "text/html")

        def _send(self, status: HTTPStatus, text: str, kind: str = "text/plain") -> None:
            data = text.encode()
            self.send_response(status)
            for name, value in (
                ("Content-Type", f"{kind}; charset=utf-8"),
                ("Content-Length", str(len(data))),
                ("Content-Security-Policy", f"{POLICY}; frame-ancestors 'none'"),
                ("Cache-Control", "no-store"),
                ("X-Content-Type-Options", "nosniff"),
                ("Cross-Origin-Resource-Policy", "same-origin"),
                ("Referrer-Policy", "no-referrer"),
            ):
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            """Nothing: the terminal shows the campaign."""

    try:
        server = _LoopbackServer((HOST, page.port), PageAnswer)
    except OSError as fault:
        came = fault.strerror or str(fault)
        raise StoreError(f"--port {page.port}", came, "a free port", "Name another, or 0 for any.") from fault
    page.port = server.server_port
    thread = Thread(target=server.serve_forever, name="pmg-page", daemon=True)
    thread.start()
    try:
        yield page
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
