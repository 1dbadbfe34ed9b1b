"""What a network predicts beyond the maps of a team, in frames."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import lidarium
from lidarium.agents.policy import PerRobot
from lidarium.envs.drawing.frame_parts import UNEXPLORED
from lidarium.envs.drawing.prediction_layer import PREDICTED, STRENGTH, PredictionLayer, tinted
from lidarium.envs.drawing.rendering import draw_frame
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings


def started(**options):
    settings = make_settings(**{"robots": 2, "resolution": 0.05, **options})
    env = ExplorationEnv("apartment", settings, "rgb_array", level="waypoint")
    env.reset(seed=0)
    return env


def drive(policy, env):
    policy.reset(env, 0)
    env.step(policy.act(env.reset(seed=0)[0]))
    return env


def changed(env):
    """Return where a frame differs from one without the layer, and both frames."""
    shown, without = env.render(), draw_frame(replace(env.scene(), prediction=None))
    return (shown != without).any(axis=2), shown, without


def test_a_tint_goes_from_the_ground_to_the_colour_of_predictions():
    ground = np.full((1, 3, 3), UNEXPLORED, np.uint8)
    left, middle, right = tinted(ground, np.array([[0.0, 0.5, 1.0]]))[0]
    assert tuple(left) == UNEXPLORED
    assert tuple(right) == PREDICTED
    assert middle == pytest.approx((np.array(UNEXPLORED) + PREDICTED) / 2, abs=0.5)


def test_unknown_cells_have_probabilities_and_known_ones_none():
    log_odds = np.zeros((120, 160), np.int8)
    log_odds[20:100, 20:80] = -10
    log_odds[18:20, 20:80] = 10
    layer = PredictionLayer()
    free = layer.cells(log_odds, 0.05)
    assert free.shape == log_odds.shape
    assert (free[log_odds != 0] == 0.0).all()
    assert free[40:80, 84].min() > 0.5 > free[2:10, 30:70].max()  # beside free space, and behind a wall
    squares, factor = layer.squares(log_odds, 0.05)
    assert factor == 4
    assert free[50, 90] == squares[12, 22]


@pytest.mark.parametrize("episode", [0, 1])
def test_maps_lie_where_robots_know_or_have_started(episode):
    layer = PredictionLayer()
    shown = []
    for known_starts in (True, False):
        env = lidarium.vector_env(2, "apartment", robots=2, resolution=0.05, known_starts=known_starts)
        env.reset(seed=0)
        engine = env.unwrapped.batch.engine
        shown.append(layer.on_floor(engine.simulation, engine.settings, episode))
    known, other = shown
    assert known.shape == other.shape
    # A map that lies turned is predicted alike, but not to the digit.
    assert np.corrcoef(known.ravel(), other.ravel())[0, 1] > 0.7


def test_frames_tint_what_is_not_explored_if_robots_observe_predictions():
    assert not changed(started())[0].any()
    is_tinted, shown, without = changed(started(observe=("pose", "predicted_map")))
    assert is_tinted.mean() > 0.05
    assert not (without[is_tinted] == 255).all(axis=1).any()  # what is explored stays white
    bluest = shown[is_tinted & (without == UNEXPLORED).all(axis=2)][:, 0].min()
    assert bluest == pytest.approx(UNEXPLORED[0] + STRENGTH * (PREDICTED[0] - UNEXPLORED[0]), abs=8)


@pytest.mark.parametrize(
    ("policy", "is_shown"),
    [
        (lidarium.policy("tour_frontier"), False),
        (lidarium.policy("predicted_tours"), True),
        (lidarium.policy("predicted_tours", predictor="nothing"), False),
        (lidarium.policy("supervised_predicted"), True),
        (PerRobot(lambda: lidarium.policy("predicted_tours")), True),
    ],
)
def test_frames_tint_it_if_the_policy_predicts(policy, is_shown):
    env = drive(policy, started())
    assert changed(env)[0].any() == is_shown
    assert policy.predicts == is_shown


def test_frames_tint_it_if_a_belief_was_asked_or_a_person_asks():
    env = started()
    assert env.belief("robot_0").predicted_map.max() == 1.0
    assert changed(env)[0].any()
    other = started()
    other.perception.predicts = True
    assert changed(other)[0].any()
    assert np.array_equal(pickle.loads(pickle.dumps(other)).render(), other.render())


def test_a_batch_shows_each_episode_its_own():
    env = lidarium.vector_env(
        2, "apartment", robots=2, resolution=0.05, observe=("pose", "predicted_map"), render_mode="rgb_array"
    )
    env.reset(seed=0)
    frames = env.render()
    env.unwrapped.batch.engine.perception.predicts = False
    assert all((frame != without).any() for frame, without in zip(frames, env.render(), strict=True))
