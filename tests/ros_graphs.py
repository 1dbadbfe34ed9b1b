"""Nodes of ROS 2 on this machine alone, each test process in a domain of its own."""

import os
import time
from contextlib import contextmanager

import numpy as np

from lidarium.mapping.grids.scan_geometry import ScanGeometry

DOMAIN = 100 + int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 64
PATIENCE_S = 20.0
GEOMETRY = ScanGeometry(beams=181, field_of_view=np.pi, range_min=0.1, range_max=8.0)


@contextmanager
def node(name="node", domain=DOMAIN):
    from lidarium.envs.ros.graph import Graph

    graph = Graph(name, domain, localhost=True)
    try:
        yield graph
    finally:
        graph.close()


def until(happens):
    """Wait until something is true; return it."""
    end = time.monotonic() + PATIENCE_S
    while not (found := happens()):
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.01)
    return found


def heard(graph, topic, count=1):
    """Return the next messages of a topic."""
    found = []
    until(lambda: found.extend(graph.take(topic)) or len(found) >= count)
    return [each.message for each in found]
