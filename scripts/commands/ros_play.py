"""`lidarium ros play`: play a recorded bag as live topics of ROS 2."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tyro.conf import Positional

from lidarium.scripts.common import Answer, notify, table
from lidarium.scripts.options import RosOptions, open_graph


@dataclass(frozen=True, kw_only=True)
class _RosPlay(RosOptions):
    """Play the scans, odometry and transforms of a bag of ROS 2 as live topics (extra ros), with `/clock`."""

    writes: ClassVar[bool] = False

    bag: Positional[Path]
    """the bag: .mcap, .db3, or a folder of these"""
    speed: float = 1.0
    """seconds of the bag in a second; 0 for as many as possible"""
    timeout_s: float = 10.0
    """longest time to wait for a reader of the scans [s]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, high in (("speed", 1000.0), ("timeout_s", 3600.0)):
            if not 0.0 <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}; want 0 to {high:g}")


def execute(command: _RosPlay) -> Answer:
    """Play the bag to its end."""
    graph = open_graph(command, "lidarium_player")
    from lidarium.envs.ros.playing import play

    notify(f"{command.bag} is played in domain {graph.domain}")
    try:
        counts = play(command.bag, graph, command.speed, timeout_s=command.timeout_s)
    finally:
        graph.close()
    return Answer({"messages": counts}, table(counts.items(), ("topic", "messages")))
