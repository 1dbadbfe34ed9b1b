"""The policies that come with the package.

A new one is a file beside this one and a line here.
"""

from functools import partial

from lidarium.agents.frontier import ExploreLite, NearestFrontier, UtilityFrontier
from lidarium.agents.policy import register_policy
from lidarium.agents.random_walk import RandomWalk
from lidarium.agents.srt.policy import SensorBasedRandomTree
from lidarium.agents.supervisor.policy import independent, oracle_starts, supervised

register_policy(
    "random_walk", RandomWalk, "drives straight on and turns by a random angle where something is near"
)
register_policy(
    "nearest_frontier",
    NearestFrontier,
    "each robot drives to its nearest frontier of the team's map (Yamauchi)",
)
register_policy(
    "nearest_frontier_own_map",
    partial(NearestFrontier, shares_map=False),
    "each robot drives to the nearest frontier of its own map",
)
register_policy(
    "utility_frontier", UtilityFrontier, "the team shares frontiers out by utility less cost (Burgard)"
)
register_policy(
    "explore_lite",
    ExploreLite,
    "least cost of distance less size of the frontier, both in metres (explore_lite)",
)
register_policy(
    "srt",
    SensorBasedRandomTree,
    "grows a tree of safe regions towards openings and the goal (sensor-based random tree)",
)
register_policy(
    "supervised",
    supervised,
    "robots explore alone; a station merges their maps, and redirects and stops them by a tree of rules",
)
register_policy(
    "independent",
    independent,
    "each robot explores the whole floor alone; a bound for teams that merge their maps",
)
register_policy(
    "oracle_starts",
    oracle_starts,
    "supervised robots that are told how they stand to each other; a bound for teams that merge",
)
