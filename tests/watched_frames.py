"""Frames of robots that do not know their starts, taken each second."""

import lidarium
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher


class Taken(Watcher):
    """Keeps what is drawn each second."""

    def __init__(self, draw):
        self.draw, self.frames = draw, []

    def step(self, env, commands):
        if int(env.world.steps[0]) % 10 == 1:
            self.frames.append(self.draw(env))


def explored(draw, floor="apartment", robots=3, horizon_s=4.0, resolution=0.05):
    settings = make_settings(
        robots=robots, resolution=resolution, horizon_s=horizon_s, known_starts=False, localization="slam"
    )
    taken = Taken(draw)
    env = WatchedExploration(floor, settings, watchers=[taken])
    run_episode(lidarium.policy("nearest_frontier_own_map"), env, 0)
    return env, taken.frames
