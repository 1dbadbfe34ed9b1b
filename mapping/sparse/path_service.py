"""Requests to a map that stays loaded: plans, obstacles that come and go, status, as lines of JSON.

References
----------
Sparse mapper, sections 1 and 7: the path server.
"""

import json
import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.graph import TopologicalGraph
from lidarium.mapping.sparse.planning import check_on_map, map_bounds, plan

MAX_LINE_BYTES = 1_000_000
"""Longest line that is read."""

MAX_OBSTACLES = 1000
"""Most obstacles at a time: all boxes are sorted again when one comes or goes."""

_OF_BROWSERS = (b"GET ", b"HEAD ", b"POST ", b"OPTIONS ")
"""Beginnings of requests that any page in a browser of this machine can send, with lines of its own behind."""

_SHOWN = 80
"""Characters of a value that an error shows."""


class PathService:
    """Answers requests about a graph, one at a time; threads wait for each other.

    Parameters
    ----------
    graph : TopologicalGraph
        The graph; the service keeps obstacles beside it.
    source : Path
        File of the map, for the status.
    """

    def __init__(self, graph: TopologicalGraph, source: Path) -> None:
        self._changing, self._source = ChangingGraph(graph), source
        self._bounds = map_bounds(graph)
        self._lock, self._began = threading.RLock(), time.monotonic()
        self._requests, self._errors = 0, 0
        self._methods: dict[str, tuple[tuple[str, ...], Callable[..., dict[str, Any]]]] = {
            "plan": (("start", "goal"), self._plan),
            "add_obstacle": (("low", "high"), self._add_obstacle),
            "remove_obstacle": (("obstacle",), self._remove_obstacle),
            "status": ((), self._status),
        }
        # The first request does not wait for the kernels.
        node = graph.nodes[0]
        plan(graph, node, node)
        self._changing.remove(self._changing.insert(np.stack([node, node])))

    def answered(self, read_line: Callable[[int], bytes]) -> Iterator[bytes]:
        """Yield an answer to each line of a stream until it ends; ``read_line`` takes a number of bytes at most."""
        while line := read_line(MAX_LINE_BYTES + 1):
            if line.startswith(_OF_BROWSERS):
                yield self.refused(f"the line {_shown(line)} is of a browser; want one object a line")
                return
            if len(line) > MAX_LINE_BYTES:
                yield self.refused(f"the line has more than {MAX_LINE_BYTES:,} bytes; want one request a line")
                while line and not line.endswith(b"\n"):
                    line = read_line(MAX_LINE_BYTES)
            elif line.strip():
                yield self.answer(line)

    def answer(self, line: bytes) -> bytes:
        """Return the answer to a request, a line of JSON each."""
        try:
            request = json.loads(line)
        except (ValueError, RecursionError) as error:
            return self.refused(f"the line {_shown(line)} is no JSON: {error}; want one object a line")
        if not isinstance(request, dict):
            return self.refused(f'the request is {_shown(request)}; want an object, as {{"id": 1, "method": "status"}}')
        name = request.pop("id", None)
        if isinstance(name, bool) or not isinstance(name, (str, int)):
            return self.refused(f"id of the request is {_shown(name)}; want a number or a text of its own")
        with self._lock:
            try:
                result = self._called(request)
            except ValueError as error:
                return self.refused(str(error), name)
            self._requests += 1
        return _line({"id": name, **result})

    def refused(self, error: str, name: str | int | None = None) -> bytes:
        """Return an answer that says what is wrong with a request."""
        with self._lock:
            self._errors += 1
        return _line({"id": name, "error": error})

    def _called(self, request: dict[str, Any]) -> dict[str, Any]:
        """Call the method of a request."""
        method = request.pop("method", None)
        if not isinstance(method, str) or method not in self._methods:
            raise ValueError(f"method is {_shown(method)}; want one of {', '.join(self._methods)}")
        fields, call = self._methods[method]
        for field in fields:
            if field not in request:
                raise ValueError(f"the request {method} has no {field}; want {', '.join(fields)}")
        for field in request:
            if field not in fields:
                raise ValueError(f"the request {method} has the unknown {field!r}; want {', '.join(fields) or 'none'}")
        return call(**request)

    def _plan(self, start: object, goal: object) -> dict[str, Any]:
        first, last = _numbers("start", start, (2, 3)), _numbers("goal", goal, (2, 3))
        for name, point in (("start", first), ("goal", last)):
            check_on_map(self._bounds, name, point)
        return plan(self._changing.graph, first, last).result

    def _add_obstacle(self, low: object, high: object) -> dict[str, Any]:
        box = np.array([_numbers(name, given, (3,)) for name, given in (("low", low), ("high", high))])
        if not (box[0] <= box[1]).all():
            raise ValueError(f"low is {_shown(low)} and high {_shown(high)}; want low below high on each axis")
        if len(self._changing.obstacles) >= MAX_OBSTACLES:
            raise ValueError(f"there are {MAX_OBSTACLES} obstacles; want one to be removed before")
        nearest = np.clip(self._bounds[:, :2].mean(axis=0), box[0, :2], box[1, :2])
        check_on_map(self._bounds, "the obstacle's nearest point", nearest)
        # What reaches out of the map would only make the index of boxes larger.
        within = np.clip(box[:, :2], *self._bounds[:, :2])
        return {"obstacle": self._changing.insert(np.column_stack([within, box[:, 2]]))}

    def _remove_obstacle(self, obstacle: object) -> dict[str, Any]:
        there = self._changing.obstacles
        if isinstance(obstacle, bool) or not isinstance(obstacle, int) or obstacle not in there:
            known = f"want one of {', '.join(map(str, there))}" if there else "there are no obstacles; add one first"
            raise ValueError(f"obstacle is {_shown(obstacle)}; {known}")
        self._changing.remove(obstacle)
        return {"obstacle": obstacle}

    def _status(self) -> dict[str, Any]:
        graph = self._changing.graph
        obstacles = self._changing.obstacles
        return {
            "map": str(self._source),
            "radius": graph.body.radius,
            "height": graph.body.height,
            "low": self._bounds[0].tolist(),
            "high": self._bounds[1].tolist(),
            "boxes": len(graph.boxes) - len(obstacles),
            "knows_floor": graph.support is not None,
            "nodes": len(graph.nodes),
            "edges": len(graph.edges),
            "obstacles": {str(number): box.tolist() for number, box in obstacles.items()},
            "requests": self._requests,
            "errors": self._errors,
            "seconds": round(time.monotonic() - self._began, 3),
            "cpu_s": round(time.process_time(), 6),
        }


def _line(answer: dict[str, Any]) -> bytes:
    return json.dumps(answer, allow_nan=False).encode() + b"\n"


def _numbers(name: str, given: object, counts: tuple[int, ...]) -> NDArray[np.float64]:
    """Return numbers of a request, finite ones."""
    if isinstance(given, list) and len(given) in counts and all(map(_is_number, given)):
        return np.array(given, np.float64)
    wanted = " or ".join({2: "[x, y]", 3: "[x, y, z]"}[count] for count in counts)
    raise ValueError(f"{name} is {_shown(given)}; want {wanted} in metres, finite numbers")


def _is_number(each: object) -> bool:
    if isinstance(each, bool) or not isinstance(each, (int, float)):
        return False
    try:
        return math.isfinite(each)
    except OverflowError:  # a whole number that no float holds
        return False


def _shown(value: object) -> str:
    text = value.decode("utf-8", "replace").strip() if isinstance(value, bytes) else json.dumps(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
