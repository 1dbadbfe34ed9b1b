"""Short episodes that compiled kernels run, or Python where ``NUMBA_DISABLE_JIT=1``: what they tell, hashed.

``python -m robustness.interpreted [CASE ...]``

Run it in the folder ``tests``. It prints a line of JSON for each case: seconds, and hashes of all parts.
"""

import json
import sys
import time

import numpy as np
from episode_ledger import Ledger
from hashed_episodes import command, drawn_floor, policy, rows, solo, team

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.lidar import Lidar

REAL = {"localization": "slam", "odometry": "typical", "noise": "datasheet", "known_starts": False}
SEEN = ("scan", "pose", "velocity", "bumper", "map", "egocentric_map")
SMALL = {"lidar": Lidar(beams=24, range_max=3.0), "resolution": 0.1, "raster_resolution": 0.1}

SMALL_ROOMS = Floor(
    "small_rooms",
    (0.0, 0.0, 4.0, 2.6),
    (Solid(np.array([[1.9, 0.0], [2.1, 0.0], [2.1, 1.6], [1.9, 1.6]])),),
    starts=np.array([[0.6, 0.8, 0.3], [1.2, 1.9, -0.4]]),
)
"""Two rooms: in Python, most of the time would go into the raster of a larger floor."""

COARSE = "--lidar lidar_360_6m --map-resolution 0.1 --set raster_resolution=0.1"

CASES = {
    "velocity": team(SMALL_ROOMS, 3, robots=2, noise="datasheet", observe=SEEN, **SMALL),
    "depth": team(drawn_floor, 2, robots=2, camera="depth_64x48", observe=("pose", "depth"), **SMALL),
    "frontier": team(SMALL_ROOMS, 2, "frontier", robots=2, radio="line_of_sight", **SMALL),
    "rows": rows("srt_l_room", 2, robots=1, threads=2, **SMALL),
    "waypoint": solo("WaypointExploration", "waypoint", 1, floor="srt_t_junction", **SMALL),
    "slam": team(SMALL_ROOMS, 4, robots=2, **REAL, **SMALL),
    "splines": team(drawn_floor, 4, robots=1, localization="splines", **SMALL),
    "splines_ekf": team(drawn_floor, 4, robots=1, localization="splines_ekf", **SMALL),
    "faults": team(drawn_floor, 3, robots=2, localization="odometry", odometry="good", battery="kobuki", **SMALL),
    "merged": team(drawn_floor, 2, "frontier", merged=False, robots=2, known_starts=False, **SMALL),
    "nearest_frontier": policy("nearest_frontier", "srt_l_room", 5, robots=1, **SMALL),
    "srt": policy("srt", "srt_l_room", 5, robots=1, **SMALL),
    "run": command("--floor srt_l_room --robots 2 --horizon-s 0.2 " + COARSE),
}


def main(names: list[str]) -> None:
    """Run cases and print what they tell."""
    for name in names or CASES:
        began = time.perf_counter()
        ledger = Ledger(1, None)
        CASES[name].run(ledger)
        took_s = round(time.perf_counter() - began, 1)
        print(json.dumps({"case": name, "seconds": took_s, **ledger.summary()}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
