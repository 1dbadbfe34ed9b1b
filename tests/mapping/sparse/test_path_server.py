"""A path server answers good and bad requests of several clients, and stays."""

import io
import json
import socket
import threading
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.path_client import HOST, PathClient
from lidarium.mapping.sparse.path_server import MAX_CLIENTS, PathServer, serve_streams
from lidarium.mapping.sparse.path_service import MAX_LINE_BYTES, MAX_OBSTACLES, PathService
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.swept_body import SweptBody

START, GOAL = [0.5, 0.5], [3.5, 0.5]
DOOR = [[1.6, 1.9, 0.0], [2.4, 3.0, 1.0]]
"""Closes the way around the shelf."""


def room():
    x, y = np.meshgrid(np.arange(0.0, 4.01, 0.2), np.arange(0.0, 3.01, 0.2))
    free = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    shelf = np.array([[[1.9, 0.0, 0.0], [2.1, 2.0, 1.5]]])
    return build_graph(free, shelf, SweptBody(radius=0.2))


@contextmanager
def served():
    with PathServer(PathService(room(), Path("room.smap"))) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def answer_to(request, service=None):
    line = request if isinstance(request, bytes) else json.dumps(request).encode()
    return json.loads((service or PathService(room(), Path("room.smap"))).answer(line))


def test_a_plan_is_that_of_the_library():
    found = plan(room(), np.array(START), np.array(GOAL))
    with served() as server, PathClient(server.port) as client:
        answer = client.plan(np.array(START, np.float32), GOAL)
    assert found.is_found
    assert answer == found.result
    assert answer["length_m"] == round(found.length, 4) > 4.0


def test_obstacles_come_and_go():
    with served() as server, PathClient(server.port) as client:
        before = client.plan(START, GOAL)
        number = client.add_obstacle(*DOOR)
        assert client.plan(START, GOAL)["reason"] == "no path"
        assert client.plan(START, [2.0, 2.5])["reason"] == "goal in collision"
        assert client.status()["obstacles"] == {str(number): DOOR}
        client.remove_obstacle(number)
        assert client.plan(START, GOAL) == before
        assert client.status()["obstacles"] == {}


def test_the_status_says_what_is_served():
    with served() as server, PathClient(server.port) as client:
        client.plan(START, GOAL)
        with pytest.raises(ValueError, match="want"):
            client.plan([9.0, 9.0], GOAL)
        status = client.status()
    graph = room()
    assert (status["map"], status["radius"], status["height"]) == ("room.smap", 0.2, 1.2)
    assert (status["boxes"], status["nodes"], status["edges"]) == (1, len(graph.nodes), len(graph.edges))
    assert (status["low"], status["high"]) == ([0.0, 0.0, -1.2], [4.0, 3.0, 1.2])
    assert (status["requests"], status["errors"]) == (1, 1)


PLAN = {"id": 7, "method": "plan", "start": START, "goal": GOAL}


@pytest.mark.parametrize(
    ("change", "thing"),
    [
        ({"start": [float("nan"), 1.0]}, "start is [NaN, 1.0]; want [x, y] or [x, y, z]"),
        ({"goal": [1.0, float("inf")]}, "goal is [1.0, Infinity]; want"),
        ({"goal": [10**400, 1.0]}, "goal is [1000"),
        ({"goal": [True, 1.0]}, "goal is [true, 1.0]; want"),
        ({"goal": "1, 1"}, 'goal is "1, 1"; want'),
        ({"goal": [1.0]}, "goal is [1.0]; want"),
        ({"start": [4.5, 1.0]}, "start is 4.5, 1; want a point on the map: x from 0.00 to 4.00, y from 0.00 to 3.00 m"),
        ({"goal": [1.0, 1.0, 8.0]}, "goal is 1, 1, 8; want a point on the map"),
        ({"speed": 2}, "the request plan has the unknown 'speed'; want start, goal"),
        ({"method": "fly"}, 'method is "fly"; want one of plan, add_obstacle, remove_obstacle, status'),
        ({"method": None}, "method is null; want one of"),
        ({"method": "remove_obstacle"}, "the request remove_obstacle has no obstacle; want obstacle"),
    ],
)
def test_a_bad_request_is_answered_by_thing_value_and_cure(change, thing):
    answer = answer_to(PLAN | change)
    assert answer["id"] == 7
    assert answer["error"].startswith(thing)
    assert set(answer) == {"id", "error"}


@pytest.mark.parametrize("field", ["start", "goal"])
def test_a_missing_field_is_named(field):
    request = {key: value for key, value in PLAN.items() if key != field}
    assert answer_to(request)["error"] == f"the request plan has no {field}; want start, goal"


@pytest.mark.parametrize(
    ("fields", "thing"),
    [
        ({"low": [1, 1, 1], "high": [2, 2, 0]}, "low is [1, 1, 1] and high [2, 2, 0]; want low below high"),
        ({"low": [1, 1], "high": [2, 2, 1]}, "low is [1, 1]; want [x, y, z]"),
        ({"low": [7, 1, 0], "high": [8, 2, 1]}, "the obstacle's nearest point is 7, 1.5; want a point on the map"),
    ],
)
def test_a_bad_obstacle_is_refused(fields, thing):
    service = PathService(room(), Path("room.smap"))
    assert answer_to({"id": 1, "method": "add_obstacle", **fields}, service)["error"].startswith(thing)
    assert answer_to({"id": 2, "method": "status"}, service)["obstacles"] == {}


def test_an_unknown_obstacle_is_refused():
    service = PathService(room(), Path("room.smap"))
    remove = {"id": 1, "method": "remove_obstacle", "obstacle": 5}
    assert answer_to(remove, service)["error"] == "obstacle is 5; there are no obstacles; add one first"
    number = answer_to({"id": 1, "method": "add_obstacle", "low": DOOR[0], "high": DOOR[1]}, service)["obstacle"]
    assert answer_to(remove | {"obstacle": 99}, service)["error"] == f"obstacle is 99; want one of {number}"


def test_no_more_obstacles_than_can_be_sorted_are_taken():
    service = PathService(room(), Path("room.smap"))
    add = {"id": 1, "method": "add_obstacle", "low": [0, 0, 0], "high": [0.1, 0.1, 1e300]}
    answers = [answer_to(add, service) for _ in range(MAX_OBSTACLES + 1)]
    assert all("obstacle" in answer for answer in answers[:-1])
    assert "want one to be removed" in answers[-1]["error"]


@pytest.mark.parametrize(
    ("line", "thing"),
    [
        (b"hello\n", "the line hello is no JSON"),
        (b"\xff\xfe\xfa\n", "the line"),
        (b"[" * 100_000 + b"\n", "the line [["),
        (b"[1]\n", "the request is [1]; want an object"),
        (b'{"method": "status"}\n', "id of the request is null; want a number or a text"),
        (b'{"id": NaN, "method": "status"}\n', "id of the request is NaN"),
        (b'{"id": true, "method": "status"}\n', "id of the request is true"),
    ],
)
def test_a_line_that_is_no_request_is_answered_without_id(line, thing):
    answer = answer_to(line)
    assert answer["id"] is None
    assert answer["error"].startswith(thing)
    assert len(answer["error"]) < 400


def test_a_long_line_is_refused_and_the_next_one_answered():
    requests = io.BytesIO(b"x" * (3 * MAX_LINE_BYTES) + b'\n\n{"id": "next", "method": "status"}')
    answers = io.BytesIO()
    serve_streams(PathService(room(), Path("room.smap")), requests, answers)
    first, second = map(json.loads, answers.getvalue().splitlines())
    assert first == {"id": None, "error": "the line has more than 1,000,000 bytes; want one request a line"}
    assert second["id"] == "next"
    assert second["errors"] == 1


@pytest.mark.parametrize("path", [b"/", b"/" + b"x" * MAX_LINE_BYTES])
def test_a_page_in_a_browser_changes_nothing(path):
    box = b'{"id": 1, "method": "add_obstacle", "low": [0, 0, 0], "high": [1, 1, 1]}\n'
    with served() as server, PathClient(server.port) as client:
        with socket.create_connection((HOST, server.port)) as other, other.makefile("rb") as answers:
            with suppress(OSError):
                other.sendall(b"POST " + path + b" HTTP/1.1\r\nHost: a\r\n\r\n" + box)
            with suppress(ConnectionResetError):  # as it left lines unread
                assert "is of a browser" in json.loads(answers.readline())["error"]
                assert answers.read() == b""
        assert client.status()["obstacles"] == {}


def test_a_client_that_leaves_in_the_middle_harms_nobody():
    with served() as server, PathClient(server.port) as client:
        for sent in (b'{"id": 1, "method": "plan", "sta', b'{"id": 1, "method": "status"}\n' * 1000, b""):
            with socket.create_connection((HOST, server.port)) as other:
                other.sendall(sent)
                # Unread answers make the system reset the connection.
                other.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
            assert client.plan(START, GOAL)["found"]


def test_several_clients_are_answered_their_own():
    goals = [[x, 2.5] for x in np.linspace(0.5, 3.5, 6)]
    expected = [plan(room(), np.array(START), np.array(goal)).result for goal in goals]
    got = {}

    def ask(port, place):
        with PathClient(port) as client:
            got[place] = [client.plan(START, goals[place]) for _ in range(50)]

    with served() as server:
        threads = [threading.Thread(target=ask, args=(server.port, place)) for place in range(len(goals))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert got == {place: [answer] * 50 for place, answer in enumerate(expected)}


def test_too_many_clients_are_told_so_and_room_is_made_by_those_who_leave():
    with served() as server:
        clients = [PathClient(server.port) for _ in range(MAX_CLIENTS)]
        for client in clients:
            client.status()
        with PathClient(server.port) as late, pytest.raises((ValueError, ConnectionError)):
            late.status()
        for client in clients:
            client.close()
        for _ in range(100):
            try:
                with PathClient(server.port) as client:
                    assert client.plan(START, GOAL)["found"]
                break
            except (ValueError, ConnectionError):
                threading.Event().wait(0.05)
        else:
            pytest.fail("no room was made")


def test_a_client_of_no_server_is_told_how_to_begin_one():
    with served() as server:
        port = server.port
        client = PathClient(port)
    with pytest.raises(ConnectionError, match=f"no path server answers at port {port}.*lidarium serve"):
        PathClient(port)
    client.close()


def test_a_port_in_use_is_named():
    with served() as server, pytest.raises(OSError, match=f"port {server.port} of {HOST} cannot be used.*--port"):
        PathServer(server.service, server.port)


def test_others_cannot_reach_it():
    with served() as server:
        assert server.server_address[0] == "127.0.0.1"
