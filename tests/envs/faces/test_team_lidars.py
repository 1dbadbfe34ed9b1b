"""Teams whose robots have lidars of their own: each senses, maps and drives as it would with that lidar alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.lidar import Lidar
from lidarium.evaluation.bounds.bound import time_bound
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.record.file import read_record
from lidarium.evaluation.record.replay import rerun
from lidarium.evaluation.report.replay_page import ReplaySampler
from lidarium.evaluation.viewing.moment import moment_of

# Lasers above the bodies do not see teammates; furniture of a floor is as high as its walls here.
NEAR = Lidar(beams=181, range_max=2.0, height=0.6)
FAR = Lidar(beams=181, range_max=8.0, field_of_view=math.pi, height=0.6)
LIDARS = [NEAR, FAR]
WALLS = tuple(
    (x, y, x + width, y + depth)
    for x, y, width, depth in [(0, 0, 24, 0.2), (0, 9.8, 24, 0.2), (0, 0, 0.2, 10), (23.8, 0, 0.2, 10), (11.9, 0, 0.2, 8)]
)
STARTS = np.array([[3.0, 3.0, 0.7], [18.0, 5.0, 2.0]])
OPTIONS = {"horizon_s": 60.0, "observe": ["scan", "velocity", "map"], "stop_coverage": None, "resolution": 0.05}


def hall():
    return Floor("hall", (0.0, 0.0, 24.0, 10.0), boxes=WALLS, starts=STARTS)
