"""The web server of a view: on this machine alone, for those who know its address, on a free port, quiet."""

import inspect
import os
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from lidarium.extras import install_command

if TYPE_CHECKING:
    from viser import ViserServer

HOST = "127.0.0.1"
"""Address at which browsers reach it: this machine only."""

LONGEST_STOP_S = 1.0
"""Maximum wait for the end of a server [s]."""


@contextmanager
def view_server(port: int) -> Iterator["ViserServer"]:
    """Serve a page at a port; 0 selects a free one."""
    try:
        import rich
        import viser
    except ImportError as error:
        raise ValueError(f"a view needs the package viser: {install_command('viewer')}") from error
    _check_free(port)
    console = rich.get_console()
    was_quiet, console.quiet = console.quiet, True  # viser writes to standard output as results do

    class LocalServer(viser.ViserServer):
        """A server that does not share its page through a public server, even if a client asks it to."""

        def request_share_url(self, verbose: bool = True) -> str | None:
            """Share nothing."""
            return None

    token = secrets.token_urlsafe(16)
    with _guarding(token):
        server = LocalServer(HOST, port, label="lidarium", verbose=False)
    server.lidarium_token = token

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
    """Return the address for a browser; its path is a secret that other pages and users of the machine do not know."""
    return f"http://{server.get_host()}:{server.get_port()}/{server.lidarium_token}/"


@contextmanager
def _guarding(token: str) -> Iterator[None]:
    """Let a server that is made meanwhile refuse requests without the token in their path, or of another page.

    viser has no hook for this: its call of ``serve`` of the package websockets is given another check of requests.
    """
    from websockets.asyncio import server as websockets

    serve = websockets.serve

    def guarded(*arguments: Any, process_request: Callable[..., Any], **options: Any) -> Any:  # noqa: ANN401
        async def check(connection: Any, request: Any) -> Any:  # noqa: ANN401
            refused = _why_refused(request, token, connection.local_address[1])
            if refused:
                return connection.respond(HTTPStatus.FORBIDDEN, f"{refused}; want the address that was printed\n")
            request.path = request.path.removeprefix(f"/{token}") or "/"
            answer = process_request(connection, request)
            return await answer if inspect.isawaitable(answer) else answer

        return serve(*arguments, process_request=check, **options)

    websockets.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets.serve = serve  # type: ignore[misc]


def _why_refused(request: Any, token: str, port: int) -> str:  # noqa: ANN401
    """Return why a request is refused, nothing if it is not: by its host, the page that it comes from, or its path."""
    hosts = (f"{HOST}:{port}", f"localhost:{port}")
    if request.headers.get("Host", "") not in hosts:  # a name of somebody else's that leads to this machine
        return "the host is not this machine"
    origin = request.headers.get("Origin")
    if origin is not None and origin not in [f"http://{host}" for host in hosts]:
        return "the request comes from another page"
    first = request.path.partition("?")[0].split("/")[1:2]
    if not first or not secrets.compare_digest(first[0].encode(), token.encode()):
        return "the address has no token"
    return ""


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
