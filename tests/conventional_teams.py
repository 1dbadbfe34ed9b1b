"""Small teams in the forms of conventions."""

import numpy as np

import lidarium
from lidarium.envs.floors.floor import Floor

OPTIONS = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m", "observe": ["scan", "pose", "map"]}
CLOSET = Floor("closet", (0.0, 0.0, 2.0, 1.6))
AHEAD = np.array([1.0, 0.2], np.float32)


def make(floor="scene_room", **options):
    return lidarium.parallel_env(floor, **{"starts": "fixed", **OPTIONS, **options})


def step(env, action=AHEAD):
    return env.step(dict.fromkeys(env.agents, action))
