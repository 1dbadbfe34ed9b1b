"""Times of the policies on the floors of the catalogue.

They are with 1, 2 and 3 robots, as a markdown table.

Perfect poses, no noise, maps of 2.5 cm as in ``lidarium run``; starts are drawn by the seed, the same for all
policies. Each entry is the median over the seeds of the simulated time until 99 % of C_free were sensed;
where a run ended short of that, the least coverage at the end stands instead.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.agents import make_policy
from lidarium.envs.exploration import ExplorationEnv
from lidarium.envs.floors.catalogue.names import floor_names, load_floor
from lidarium.envs.floors.starts import draw_starts
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.episodes.runner import run_episode

POLICIES = ("random_walk", "nearest_frontier", "nearest_frontier_own_map", "utility_frontier", "explore_lite")
TEAMS = (1, 2, 3)
GOAL = 0.99


def drawn_starts(env: ExplorationEnv, floor: str, seed: int) -> NDArray[np.float64]:
    """Draw where the robots start, (robots, 3) [m, rad].

    The starts that come with the floor would be the same for every seed.
    """
    settings = env.settings
    tables = floor_tables(
        load_floor(floor), settings.raster_resolution, settings.lidar.height, settings.robot.height
    )
    return draw_starts(tables.body, settings.robot.radius, settings.robots, np.random.default_rng(seed))


def entry(floor: str, policy: str, robots: int, seeds: Sequence[int], horizon_s: float) -> str:
    """Run a policy on a floor once per seed and return the entry of the table."""
    env = ExplorationEnv(
        floor, make_settings(robots=robots, resolution=0.025, stop_coverage=GOAL, horizon_s=horizon_s)
    )
    times, coverages, collisions = [], [], 0
    for seed in seeds:
        began = time.perf_counter()
        episode = run_episode(make_policy(policy), env, seed, {"starts": drawn_starts(env, floor, seed)})
        scorer = episode.env.scorer
        times.append(scorer.times.get(GOAL))
        coverages.append(scorer.coverage)
        collisions += int(env.world.collisions.sum())
        seconds = time.perf_counter() - began
        print(
            f"{floor} {policy} {robots} seed {seed}: {scorer.coverage:.4f} in {scorer.time:.0f} s "
            f"({seconds:.1f} s)",
            file=sys.stderr,
        )
    reached = [value for value in times if value is not None]
    if len(reached) == len(times):
        text = f"{statistics.median(reached):.0f} s"
    else:
        text = f"{100.0 * min(coverages):.1f} %"
    return f"{text}, {collisions} contacts" if collisions else text


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--floors", nargs="+", default=list(floor_names()), help="floors, as for lidarium run"
    )
    parser.add_argument("--policies", nargs="+", default=list(POLICIES), help="names of policies")
    parser.add_argument("--seeds", type=int, default=3, help="runs of each entry")
    parser.add_argument(
        "--horizon-s", type=float, default=3600.0, help="simulated time after which a run is cut [s]"
    )
    arguments = parser.parse_args()
    print(
        "| floor | policy | " + " | ".join(f"{team} robot{'s' if team > 1 else ''}" for team in TEAMS) + " |"
    )
    print("|---|---|" + "---:|" * len(TEAMS))
    for floor in arguments.floors:
        for policy in arguments.policies:
            entries = [
                entry(floor, policy, team, range(arguments.seeds), arguments.horizon_s) for team in TEAMS
            ]
            print(f"| {floor} | {policy} | " + " | ".join(entries) + " |", flush=True)


if __name__ == "__main__":
    main()
