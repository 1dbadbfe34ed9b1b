"""A hall with openings, for tests of explorers that remember a map."""

import numpy as np

from lidarium.agents.srt.memories import MapMemory
from lidarium.agents.srt.motion import Limits
from lidarium.agents.srt.senses import Senses
from lidarium.envs.onboard.navigation import NavigationMap

RADIUS, RESOLUTION = 0.2, 0.05
LIMITS = Limits(speed=0.5, turn_rate=1.5, deceleration=0.5, radius=RADIUS)


def hall(openings):
    """Return the map of a hall of 12 x 4 m whose walls were seen, but for stretches (x from, x to) of the
    upper one."""
    log_odds = np.zeros((120, 320), np.int8)
    log_odds[20:100, 20:260] = -40
    log_odds[19], log_odds[:, 19], log_odds[:, 260], log_odds[100] = 40, 40, 40, 40
    for low, high in openings:
        log_odds[100, 20 + round(low / RESOLUTION) : 20 + round(high / RESOLUTION)] = 0
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 120, 0, 320))
    return MapMemory(navigation, RADIUS)


def senses_at(x, y, theta=0.0):
    """Return what a robot at a place of the hall [m] tells, its lower left corner at (1, 1)."""
    return Senses(0.0, np.array([x + 1.0, y + 1.0, theta]), np.full(3, np.inf, np.float32), False, None, [])
