"""Robots that have driven a while on a generated floor."""

import numpy as np

import lidarium


def driven(steps=30, **options):
    env = lidarium.parallel_env(
        "building:5", **{"starts": "fixed", "robots": 3, "stop_coverage": None, "map_cells": 64, **options}
    )
    env.reset(seed=2)
    generator = np.random.default_rng(0)
    for _ in range(steps):
        env.step({agent: generator.uniform(-0.2, 1.0, 2).astype(np.float32) for agent in env.agents})
    return env
