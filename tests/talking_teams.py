"""Small teams whose robots send each other numbers."""

OPTIONS = {"robots": 3, "map_cells": 32, "lidar": "lidar_360_6m", "observe": ["pose"]}


def actions(env, draws):
    return {agent: draws[agent].sample() for agent in env.agents}


def drawn(env, seed=0):
    spaces = {agent: env.action_space(agent) for agent in env.possible_agents}
    for k, space in enumerate(spaces.values()):
        space.seed(seed + k)
    return spaces
