"""The web server of a view: on this machine alone, on a port that is free, quiet."""

import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viser import ViserServer

HOST = "127.0.0.1"
"""Where browsers reach it: from this machine."""

LONGEST_STOP_S = 1.0
"""How long the end of a server is waited for [s]."""

MISSING = 'a view needs the package viser; pip install "lidarium[viewer]"'


@contextmanager
def view_server(port: int) -> Iterator["ViserServer"]:
    """Serve a page at a port, any free one where 0."""
    try:
        import rich
        import viser
    except ImportError as error:
        raise ValueError(MISSING) from error
    _check_free(port)
    console = rich.get_console()
    was_quiet, console.quiet = console.quiet, True  # viser writes to standard output, where results go

    class LocalServer(viser.ViserServer):
        """A server that nobody can ask, from a page of others either, to be shared by a public one."""

        def request_share_url(self, verbose: bool = True) -> str | None:
            """Share nothing."""
            return None

    server = LocalServer(HOST, port, label="lidarium", verbose=False)

    def stop() -> None:
        server.stop()
        console.quiet = was_quiet

    try:
        if port not in (0, server.get_port()):  # taken since; viser goes on to the next
            raise OSError(_unusable(port, "Address already in use"))
        yield server
    finally:
        # Nobody can connect any more at once. Browsers keep spare connections open, for whose end viser waits
        # some seconds: that goes on by itself, and ends with the process.
        ending = threading.Thread(target=stop, daemon=True)
        ending.start()
        ending.join(LONGEST_STOP_S)


def address_of(server: "ViserServer") -> str:
    """Return the address for a browser."""
    return f"http://{server.get_host()}:{server.get_port()}"


def _check_free(port: int) -> None:
    with socket.socket() as probe:
        if os.name == "posix":  # what a server that has just ended leaves behind does not count as use
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise OSError(_unusable(port, error.strerror or str(error))) from error


def _unusable(port: int, why: str) -> str:
    return f"port {port} of {HOST} cannot be used: {why}; want another --view-port, or 0 for any that is free"
