"""`lidarium serve`: keep a sparse map loaded and answer requests for paths."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tyro.conf import Positional

from lidarium.mapping.sparse.path_client import HOST
from lidarium.mapping.sparse.path_client import PathClient as PathClient
from lidarium.scripts.commands.plan import graph_for
from lidarium.scripts.common import Answer, Command, notify


@dataclass(frozen=True, kw_only=True)
class _Serve(Command):
    """Keep a sparse map and its graph loaded and answer requests for paths.

    Requests and answers are lines of JSON. They come by standard input, which ends the server when it ends, or
    from programs on this machine with --port, until Ctrl-C.
    """

    compiles: ClassVar[bool] = True
    writes: ClassVar[bool] = False

    map: Positional[Path]
    """the map, as `lidarium sparse-map` writes it"""
    port: int | None = None
    """port of 127.0.0.1, 0 for any that is free; standard input if not given"""
    radius: float = 0.3
    """radius of the robot [m]"""
    height: float = 1.2
    """height of the robot [m]"""
    max_step: float = 0.05
    """highest step of the floor, up or down, that the robot climbs [m]"""
    clearance_weight: float = 0.0
    """additional cost of paths near obstacles, as a share"""


def execute(command: _Serve) -> Answer:
    """Serve until the end of the input, or Ctrl-C."""
    from lidarium.mapping.sparse.map_files import read_sparse_map
    from lidarium.mapping.sparse.path_server import PathServer, check_port, serve_streams
    from lidarium.mapping.sparse.path_service import PathService

    if command.port is not None:
        check_port(command.port)
    sparse_map, _ = read_sparse_map(command.map)
    graph, remarks = graph_for(command, sparse_map)
    for remark in remarks:
        notify(remark)
    service = PathService(graph, command.map)
    if command.port is None:
        notify(f"{command.map} is served: requests come by standard input, a line each")
        serve_streams(service, sys.stdin.buffer, sys.stdout.buffer)
        return Answer()
    with PathServer(service, command.port) as server:
        notify(f"{command.map} is served at port {server.port} of {HOST} until Ctrl-C")
        server.serve_forever()
    return Answer()
