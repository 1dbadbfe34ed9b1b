"""Plays the scans, odometry and transforms of a bag as live topics."""

import time
from collections.abc import Callable
from pathlib import Path

from lidarium.envs.ros.graph import Graph
from lidarium.mapping.files.bags.messages import LASER_SCAN, READ
from lidarium.mapping.files.bags.storages import STORAGE_ERRORS, WANTED, open_storages
from lidarium.mapping.files.guarded_reading import reading, reason

_NANO = 1e-9


def play(
    path: Path,
    graph: Graph,
    speed: float = 1.0,
    *,
    timeout_s: float = 10.0,
    after_scan: Callable[[], None] = lambda: None,
) -> dict[str, int]:
    """Publish the messages of a bag of ROS 2 as they were recorded, with their log times as ``/clock``.

    It begins when the scans have a subscriber, or after a timeout.

    Parameters
    ----------
    speed : float
        Seconds of the bag in a second; 0 for as many as possible.
    timeout_s : float
        Maximum time to wait for a subscriber [s].
    after_scan : callable
        Called after each scan.

    Returns
    -------
    dict of str to int
        Number of messages by topic.
    """
    with reading(path, "a whole bag", WANTED):
        try:
            with open_storages(path) as storages:
                if any(storage.is_ros1 for storage in storages):
                    raise ValueError(f"{path} is a bag of ROS 1; want one of ROS 2, as rosbags-convert makes")
                types = {name: kind for each in storages for name, kind in each.types.items() if kind in READ}
                messages = [message for each in storages for message in each.messages(list(types))]
        except STORAGE_ERRORS as error:
            raise ValueError(f"{path} is not a whole bag ({reason(error)}); {WANTED}") from error
    if not messages:
        raise ValueError(f"{path} has no scans, odometry or transforms; want a bag of a robot")
    messages.sort(key=lambda message: message[0])
    for topic, kind in types.items():
        graph.advertise(topic, kind)
    scans = [topic for topic, kind in types.items() if kind == LASER_SCAN]
    until = time.monotonic() + timeout_s
    while time.monotonic() < until and not any(map(graph.subscribers, scans)):
        time.sleep(0.02)
    time.sleep(min(timeout_s, 0.2))  # readers of the other topics
    began, first = time.monotonic(), messages[0][0]
    counts = dict.fromkeys(types, 0)
    for stamp, topic, content in messages:
        if speed > 0.0:
            time.sleep(max(began + (stamp - first) * _NANO / speed - time.monotonic(), 0.0))
        if types[topic] == LASER_SCAN:
            graph.clock(stamp * _NANO)
        graph.publish(topic, types[topic], content)
        counts[topic] += 1
        if topic in scans:
            after_scan()
    return counts
