"""Episodes that are run again with one decision changed."""

import numpy as np
import pytest

from lidarium.training.places import Place
from lidarium.training.replays.replaying import Recorder, classic_preferences, replays_of, times_of
from lidarium.training.settings import TrainingSettings


@pytest.fixture(scope="module")
def place():
    return Place("apartment:7", TrainingSettings(settings={"resolution": 0.05}).team(1), 3)


@pytest.fixture(scope="module")
def samples(place):
    return replays_of(place, classic_preferences, 8)


def test_a_replay_changes_one_decision_and_goes_on(place):
    episode = Recorder(classic_preferences)
    times = times_of(place, episode)
    number = next(k for k, each in enumerate(episode.decisions) if each.mask.sum() > 1)
    decision = episode.decisions[number]
    other = next(k for k in np.flatnonzero(decision.mask) if k != episode.choices[number])
    replay = Recorder(classic_preferences, (number, int(other)))
    times_of(place, replay)
    assert replay.choices[:number] == episode.choices[:number]
    assert replay.choices[number] == other
    for one, again in zip(episode.decisions[: number + 1], replay.decisions, strict=False):
        np.testing.assert_array_equal(one.options, again.options)
    assert np.isfinite(times).all()
    assert (np.diff(times) >= 0.0).all()


def test_the_same_replay_takes_the_same_time(place, samples):
    again = replays_of(place, classic_preferences, 8)
    np.testing.assert_array_equal(samples.replayed, again.replayed)
    np.testing.assert_array_equal(samples.other, again.other)
    np.testing.assert_array_equal(samples.decisions.options, again.decisions.options)


def test_samples_hold_other_options_that_were_allowed(samples):
    assert 1 <= len(samples) <= 8
    rows = np.arange(len(samples))
    assert samples.decisions.mask[rows, samples.other].all()
    assert samples.decisions.mask[rows, samples.chosen].all()
    assert (samples.other != samples.chosen).all()
    assert (samples.decisions.scores[rows, samples.chosen] == 0.0).all()
    assert np.isfinite(samples.times).all()
    assert (samples.replayed != samples.times).any()


def test_replays_that_take_long_are_given_up(place):
    assert np.isinf(times_of(place, Recorder(classic_preferences), horizon_s=5.0)[-1])


def test_an_episode_that_sees_too_little_has_no_samples(place):
    from dataclasses import replace

    short = replace(place, settings=replace(place.settings, horizon_s=5.0))
    assert replays_of(short, classic_preferences, 8) is None
