"""Client of a path server."""

import json
import socket
from collections.abc import Sequence
from itertools import count
from types import TracebackType
from typing import Any

HOST = "127.0.0.1"
"""Address of path servers: this machine only."""


class PathClient:
    """Asks ``lidarium serve`` for paths.

    One thread uses it at a time. It closes its connection at the end of a ``with`` block.

    Parameters
    ----------
    port : int
        Port of the server on this machine.
    timeout_s : float
        Longest wait for an answer [s].

    Raises
    ------
    ConnectionError
        If no server is at the port, or it has ended. Requests that the server refuses raise ``ValueError``.
    """

    def __init__(self, port: int, timeout_s: float = 10.0) -> None:
        try:
            self._socket = socket.create_connection((HOST, port), timeout_s)
        except (OSError, OverflowError) as error:
            raise ConnectionError(
                f"no path server answers at port {port} of {HOST}: {error}; want one that `lidarium serve MAP --port "
                "PORT` has begun"
            ) from error
        # Requests are short, and wait for nothing that could be sent with them.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._answers, self._ids = self._socket.makefile("rb"), count(1)

    def __enter__(self) -> "PathClient":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._answers.close()
        self._socket.close()

    def plan(self, start: Sequence[float], goal: Sequence[float]) -> dict[str, Any]:
        """Plan a path between two points x, y or x, y, z [m].

        Returns ``found``, ``reason``, ``length_m``, ``points`` and ``nodes``, as in `path.json`.
        """
        return self._asked("plan", start=_listed(start), goal=_listed(goal))

    def add_obstacle(self, low: Sequence[float], high: Sequence[float]) -> int:
        """Add a box by its low and its high corner x, y, z [m]; return its number."""
        return int(self._asked("add_obstacle", low=_listed(low), high=_listed(high))["obstacle"])

    def remove_obstacle(self, obstacle: int) -> None:
        """Remove an obstacle by its number."""
        self._asked("remove_obstacle", obstacle=int(obstacle))

    def status(self) -> dict[str, Any]:
        """Return what is served: map, body, size, obstacles, and requests so far."""
        return self._asked("status")

    def _asked(self, method: str, **fields: object) -> dict[str, Any]:
        request = {"id": next(self._ids), "method": method, **fields}
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
            line = self._answers.readline()
        except OSError as error:
            self.close()  # an answer that comes later would be taken for that of the next request
            raise ConnectionError(f"the path server does not answer: {error}; want it to run") from error
        if not line.endswith(b"\n"):
            raise ConnectionError("the path server has ended; want it to run")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ValueError(answer["error"])
        if answer.pop("id") != request["id"]:
            raise ConnectionError("the path server answered another request; want a client for each thread")
        return answer


def _listed(point: Sequence[float]) -> list[float]:
    """Return numbers of any kind, such as NumPy's, as JSON has them."""
    return [float(x) for x in point]
