"""Serves one page to the browser of this machine: one document, no outside address."""

from __future__ import annotations

import errno
import ipaddress
import secrets
import socket
import warnings
from collections.abc import Callable
from typing import Any

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.core.validation import silence
from bokeh.core.validation.warnings import EMPTY_LAYOUT
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.ioloop import IOLoop
from tornado.web import OutputTransform, RedirectHandler, RequestHandler

from specan.errors import RequestError

LOOPBACK = "127.0.0.1"
silence(EMPTY_LAYOUT)  # a tab without settings has an empty row of them


def start_server(fill: Callable[[Document], object], address: str = LOOPBACK, port: int = 0) -> PageServer:
    """A running server of one page; nothing else is served but Bokeh's own scripts.

    Its address, which holds a secret, is the only way to the page; see `specan.inspect.server`.

    Parameters
    ----------
    fill : callable
        Puts the page into a document, once for every browser window.
    address : str
        Network address of the page.
    port : int
        0 takes any free one.

    Raises
    ------
    RequestError
        The port is in use, or the address is not one of this machine.
    """

    # A widget that is taken off the page and put back is known to the browser already.
    warnings.filterwarnings("ignore", message="reference already known")
    server = PageServer(fill, f"[{address}]" if ":" in address else address, address, port)
    server.start()
    return server


def _bound(address: str, port: int) -> tuple[list[socket.socket], int]:
    """Sockets of an address, and the port: any free one for 0; a clear message where it is not available."""
    try:
        return bind_sockets(address, port)
    except OSError as fault:
        if fault.errno in (errno.EADDRINUSE, errno.EACCES):
            raise RequestError(
                f"port {port} of {address} is not available ({fault.strerror or fault})",
                remedy="another specan inspect may be running; choose another --port, or leave it out",
            ) from None
        raise RequestError(
            f"{address} is not an address of this machine ({fault.strerror or fault})",
            expected=f"such as {LOOPBACK}",
        ) from None


# Bokeh's server behind a guard: who does not know the page's address gets nothing.
#
# A server on 127.0.0.1 is reached by every page that is open in the same browser and by every user of the same machine.
# Three things are wanted of each request:
#
# - Its ``Host`` is the address that the server is bound to. A foreign name that is made to resolve to this machine (DNS
#   rebinding) would otherwise be an origin of its own, whose scripts may read the page.
# - Its path begins with a secret that is drawn anew at each start (128 bits) and is in the address that is printed.
#   The command line of a browser is seen by every user of the machine: the browser is started with another address,
#   which leads to the page once.
# - A websocket, over which effects are accepted, names its ``Origin``, and that is the page itself.
#
# No answer may be shown in a frame of another page, where a click could be led astray.

_HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",  # the address holds the secret
    "X-Content-Type-Options": "nosniff",
}


class PageServer(BaseServer):
    """Serves one page under a secret address.

    Attributes
    ----------
    url : str
        Address of the page, with its secret.
    first_url : str
        Address that leads there once, for the command line of a browser.
    """

    def __init__(self, fill: Callable[[Document], object], host: str, address: str, port: int) -> None:
        sockets, port = _bound(address, port)
        key, code = secrets.token_urlsafe(16), secrets.token_urlsafe(16)
        app = _Guarded(f"{host}:{port}", key, code, {"/": Application(FunctionHandler(fill))})
        http = HTTPServer(app, xheaders=False)
        http.start(1)
        http.add_sockets(sockets)
        super().__init__(IOLoop.current(), app, http)
        self.url, self.first_url = (f"http://{host}:{port}/{word}/" for word in (key, code))


class _Guarded(BokehTornado):
    def __init__(self, host: str, key: str, code: str, applications: dict[str, Application]) -> None:
        self._host, self._key, self._code = host, key, code
        super().__init__(
            applications,
            prefix=key,
            extra_websocket_origins=[host],
            use_index=False,
            redirect_root=False,
        )
        self.add_transform(_Unframed)

    def find_handler(self, request: HTTPServerRequest, **more: Any) -> Any:
        """Look at every request before any other code does."""
        if self._code and self._known(request, self._code):
            self._code = ""
            return self.get_handler_delegate(
                request, RedirectHandler, {"url": f"/{self._key}/", "permanent": False}
            )
        if not self._known(request, self._key):
            return self.get_handler_delegate(request, _Refused)
        return super().find_handler(request, **more)

    def _known(self, request: HTTPServerRequest, word: str) -> bool:
        host = request.headers.get("Host", "")
        if not self._is_own(host):
            return False
        if request.headers.get("Upgrade") is not None and request.headers.get("Origin") != f"http://{host}":
            return False
        path = (request.path or "").split("/")
        return len(path) > 1 and secrets.compare_digest(path[1].encode(), word.encode())

    def _is_own(self, host: str) -> bool:
        """Whether a Host is the address that the server is bound to.

        Bound to all addresses of a machine (0.0.0.0), it takes any address, but no name: a name can be made to
        resolve to anything.
        """
        if host == self._host:
            return True
        own, _, own_port = self._host.rpartition(":")
        given, _, port = host.rpartition(":")
        try:
            every = ipaddress.ip_address(own.strip("[]")).is_unspecified
            return every and port == own_port and bool(ipaddress.ip_address(given.strip("[]")))
        except ValueError:
            return False


class _Refused(RequestHandler):
    def prepare(self) -> None:
        """Say the same to everyone: neither what is here nor what was wrong."""
        if self.request.path == "/favicon.ico":  # every browser asks for it, without the secret
            self.set_status(204)
            self.finish()
            return
        self.set_status(403)
        self.finish("This address is not known here. Open the one that specan inspect has printed.\n")


class _Unframed(OutputTransform):
    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        """Add the headers that every answer carries."""
        for name, value in _HEADERS.items():
            headers[name] = value
        headers.pop("Access-Control-Allow-Origin", None)  # of Bokeh's autoload.js: for pages from elsewhere
        return status_code, headers, chunk
