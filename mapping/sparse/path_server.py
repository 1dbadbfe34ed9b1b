"""The path service at a port of this machine, and on standard input."""

import os
import socketserver
import sys
import threading
from contextlib import suppress
from typing import Any, BinaryIO

from lidarium.mapping.sparse.path_client import HOST
from lidarium.mapping.sparse.path_service import PathService

MAX_CLIENTS = 64
"""Most clients at a time, each with a thread."""


def check_port(port: int) -> None:
    """Check the number of a port."""
    if not 0 <= port <= 65535:
        raise ValueError(f"port is {port}; want 0 to 65535, 0 for any that is free")


class PathServer(socketserver.ThreadingTCPServer):
    """Serves a path service to programs on this machine, several at a time, until `shutdown`.

    Parameters
    ----------
    service : PathService
        Answers the requests.
    port : int
        Port of 127.0.0.1; 0 for any that is free.
    """

    allow_reuse_address = os.name == "posix"  # connections left by a server that has ended do not count as use
    daemon_threads, block_on_close = True, False
    request_queue_size = MAX_CLIENTS

    def __init__(self, service: PathService, port: int = 0) -> None:
        check_port(port)
        self.service, self._clients, self._lock = service, 0, threading.Lock()
        try:
            super().__init__((HOST, port), _Connection)
        except OSError as error:
            raise OSError(
                f"port {port} of {HOST} cannot be used: {error.strerror or error}; want another --port, or 0 for any "
                "that is free"
            ) from error

    @property
    def port(self) -> int:
        """The port."""
        return int(self.server_address[1])

    def process_request(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Begin a thread for a client, if there are not too many."""
        with self._lock:
            self._clients += 1
            is_one_too_many = self._clients > MAX_CLIENTS
        if is_one_too_many:
            with suppress(OSError):
                request.sendall(self.service.refused(f"{MAX_CLIENTS} clients are connected; want fewer at a time"))
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:  # noqa: ANN401
        """Close the connection of a client."""
        super().shutdown_request(request)
        with self._lock:
            self._clients -= 1

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        """Ignore that a client has gone; report everything else."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Connection(socketserver.StreamRequestHandler):
    """A client."""

    disable_nagle_algorithm = True
    server: PathServer

    def handle(self) -> None:
        """Answer each line."""
        for answer in self.server.service.answered(self.rfile.readline):
            self.wfile.write(answer)


def serve_streams(service: PathService, requests: BinaryIO, answers: BinaryIO) -> None:
    """Answer the lines of a stream until it ends."""
    for answer in service.answered(requests.readline):
        answers.write(answer)
        answers.flush()
