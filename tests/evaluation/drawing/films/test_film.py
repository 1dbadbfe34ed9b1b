"""A film of a run has frames at equal simulated time, and holds what happens."""

import numpy as np
import pytest
from films_read import read_film, share_of

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, team_colours
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.films.film import Film, ScanFrames, film
from lidarium.evaluation.drawing.films.formats import FilmSettings
from lidarium.evaluation.drawing.films.map_frames import MapFrames
from lidarium.evaluation.drawing.films.own_maps import JOINED
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration


def filmed(path, frames_of, settings, policy="nearest_frontier", **options):
    """Film a run of two robots; return its episode and its film."""
    chosen = {"robots": 2, "resolution": 0.05, "horizon_s": 6.0, **options}
    env, decides = WatchedExploration("apartment", make_settings(**chosen)), lidarium.policy(policy)
    with film(path, frames_of(decides), settings) as camera:

        def begin(current):
            if camera not in env.watchers:
                camera.begin(current)
                env.watchers.append(camera)

        episode = run_episode(decides, env, 0, on_decision=begin)
        assert not path.exists()
        camera.end(env)
    return episode, read_film(path)


@pytest.mark.parametrize(("ending", "rate"), [(".mp4", 20), (".gif", 10), (".webp", 10)])
def test_a_film_has_frames_at_equal_simulated_time(tmp_path, ending, rate):
    path = tmp_path / f"run{ending}"
    settings = FilmSettings(speed=float(rate), width=360)
    _, found = filmed(path, lambda policy: ScanFrames(360), settings)
    # A frame at 0, 1, ... 6 s, and the last one held for 1.5 s.
    assert found.seconds == pytest.approx((7 + 1.5 * rate) / rate)
    assert found.frames.shape[2] == 360
    assert share_of(found.frames[0], EXPLORED) < share_of(found.frames[-1], EXPLORED)
    assert all(share_of(found.frames[k], colour) > 1e-4 for k in (0, -1) for colour in team_colours(2))
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_a_slow_film_has_several_frames_of_a_time_step(tmp_path):
    settings = FilmSettings(speed=1.0, width=360, frames_per_second=20)
    _, found = filmed(tmp_path / "run.mp4", lambda policy: ScanFrames(360), settings, horizon_s=1.0)
    # Frames at 0, 0.05, ... 1 s.
    assert len(found.frames) == 21 + 30


def test_maps_are_in_their_robots_colours_until_they_are_joined(tmp_path):
    # On the datasheet's noise the station joins the two maps within this time.
    options = {"known_starts": False, "horizon_s": 40.0, "noise": "datasheet", "robots": 3}
    settings = FilmSettings(speed=10.0, width=480)
    episode, found = filmed(
        tmp_path / "run.gif", lambda policy: MapFrames(policy, 480), settings, "supervised", **options
    )
    joins = [join for join in episode.policy.report().supervision.joins if join.is_used]
    assert joins
    assert found.frames.shape[2] == 480
    first, last = found.frames[0], found.frames[-1]
    assert all(share_of(first, colour) > 0.005 for colour in team_colours(3))
    assert share_of(first, EXPLORED) < share_of(last, EXPLORED)
    assert share_of(first, JOINED) == 0.0
    assert max(share_of(frame, JOINED) for frame in found.frames) > 0.02
    # Each time at which maps are joined is held for 1.8 s, and the last frame for 1.5 s.
    assert found.seconds > episode.env.scorer.time / 10.0 + 1.8 + 1.5 - 0.2


class Counted:
    """Frames of one colour each, of which something happens at one time."""

    def __init__(self, at_s):
        self.at_s, self.times = at_s, []

    def happens(self, env):
        return env.scorer.time == pytest.approx(self.at_s)

    def draw(self, env):
        self.times.append(env.scorer.time)
        return np.zeros((90, 120, 3), np.uint8)


class Shelf:
    """A writer that counts."""

    rate = 10.0

    def __init__(self):
        self.held = []

    def append_data(self, frame):
        self.held.append(1)

    def hold(self, frame, seconds):
        self.held.append(round(seconds * self.rate))


def test_what_happens_between_frames_is_held():
    env = WatchedExploration("apartment", make_settings(robots=1, resolution=0.05, horizon_s=3.0))
    frames, shelf = Counted(1.5), Shelf()
    env.watchers.append(Film(shelf, frames, speed=10.0))
    run_episode(lidarium.policy("random_walk"), env, 0)
    assert frames.times == pytest.approx([0.0, 1.0, 1.5, 2.0, 3.0])
    assert shelf.held == [1, 1, 18, 1, 1]
