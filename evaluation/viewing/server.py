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
"""Address at which browsers reach it: this machine only."""

LONGEST_STOP_S = 1.0
"""Maximum wait for the end of a server [s]."""

MISSING = 'a view needs the package viser; pip install "lidarium[viewer]"'


@contextmanager
def view_server(port: int) -> Iterator["ViserServer"]:
    """Serve a page at a port; 0 selects a free one."""
    try:
        import rich
        import viser
    except ImportError as error:
        raise ValueError(MISSING) from error
    _check_free(port)
    console = rich.get_console()
    was_quiet, console.quiet = console.quiet, True  # viser writes to standard output as results do

    class LocalServer(viser.ViserServer):
        """A server that does not share its page through a public server, even if a client asks it to."""

        def request_share_url(self, verbose: bool = True) -> str | None:
            """Share nothing."""
            return None

    server = LocalServer(HOST, port, label="lidarium", verbose=False)

    def stop() -> None:
        server.stop()
        console.quiet = was_quiet

    try:
        if port not in (0, server.get_port()):  # taken since; viser continues with the next
            raise OSError(_unusable(port, "Address already in use"))
        yield server
    finally:
        # New connections are refused at once. Browsers keep spare connections open, and viser waits some seconds for
        # their end: that continues in the background, and ends with the process.
        ending = threading.Thread(target=stop, daemon=True)
        ending.start()
        ending.join(LONGEST_STOP_S)


def address_of(server: "ViserServer") -> str:
    """Return the address for a browser."""
    return f"http://{server.get_host()}:{server.get_port()}"


def _check_free(port: int) -> None:
    with socket.socket() as probe:
        if os.name == "posix":  # connections left by a server that has just ended do not count as use
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise OSError(_unusable(port, error.strerror or str(error))) from error


def _unusable(port: int, why: str) -> str:
    return f"port {port} of {HOST} cannot be used: {why}; want another --view-port, or 0 for any that is free"
