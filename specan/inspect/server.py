"""Serves one page to the browser of this machine: one document, no outside address."""

from __future__ import annotations

import ipaddress
import socket
import warnings
import webbrowser
from collections.abc import Callable
from typing import TYPE_CHECKING

from specan.errors import RequestError

if TYPE_CHECKING:
    from bokeh.document import Document

    from specan.inspect.guarded_server import PageServer

LOOPBACK = "127.0.0.1"


def start_server(fill: Callable[[Document], None], address: str = LOOPBACK, port: int = 0) -> PageServer:
    """A running server of one page; nothing else is served but Bokeh's own scripts.

    Its address, which holds a secret, is the only way to the page; see `specan.inspect.guarded_server`.

    Parameters
    ----------
    fill : callable
        Puts the page into a document, once for every browser window.
    address : str
        Where to listen.
    port : int
        0 takes any free one.

    Raises
    ------
    RequestError
        The port is in use, or the address is not one of this machine.
    """
    from specan.inspect.guarded_server import PageServer

    # A widget that is taken off the page and put back is known to the browser already.
    warnings.filterwarnings("ignore", message="reference already known")
    port = _available(address, port)
    server = PageServer(fill, _in_url(address), address, port)
    server.start()
    return server


def open_browser(url: str) -> bool:
    """Show the page in the user's browser; False where there is none."""
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False


def _available(address: str, port: int) -> int:
    """The port, or any free one for 0; a clear message where it is not available."""
    family = socket.AF_INET6 if _is_v6(address) else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as fault:
            if port and _is_own(address):
                raise RequestError(
                    f"port {port} of {address} is not available ({fault.strerror or fault})",
                    remedy="another specan inspect may be running; choose another --port, or leave it out",
                ) from None
            raise RequestError(
                f"{address} is not an address of this machine ({fault.strerror or fault})",
                expected=f"such as {LOOPBACK}",
            ) from None
        except OverflowError:
            raise RequestError(f"there is no port {port}", expected="0 to 65535") from None
        return int(probe.getsockname()[1])


def _is_own(address: str) -> bool:
    with socket.socket(socket.AF_INET6 if _is_v6(address) else socket.AF_INET) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return True


def _is_v6(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).version == 6
    except ValueError:  # a name
        return False


def _in_url(address: str) -> str:
    return f"[{address}]" if _is_v6(address) else address
