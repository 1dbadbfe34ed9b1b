"""Keys, buttons and clicks become actions of a robot."""

from types import SimpleNamespace

import numpy as np
import pytest
from recorded_scene import RecordedServer

from lidarium.agents.by_hand import ByHand
from lidarium.envs.onboard.radio.messages import Stop, Target
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.viewing.hand import BACK, FORWARD, HALT, KEYS, LEFT, RIGHT, DrivenView, Hand

SETTINGS = {"resolution": 0.05, "horizon_s": 4.0}


def test_a_robot_goes_on_until_it_is_told_otherwise():
    hand = Hand()
    assert hand().tolist() == [0.0, 0.0]
    for what, action in (
        (FORWARD, [1.0, 0.0]),
        (LEFT, [1.0, 0.5]),
        (RIGHT, [1.0, -0.5]),
        (FORWARD, [1.0, 0.0]),
        (BACK, [-0.5, 0.0]),
        (HALT, [0.0, 0.0]),
        (LEFT, [0.0, 0.5]),
    ):
        hand.press(what)
        assert hand().tolist() == action


def test_a_goal_lasts_until_the_next_key_and_an_end_for_good():
    hand = Hand()
    hand.press(FORWARD)
    hand.go_to(1.0, 2.0)
    assert hand() == Target(1.0, 2.0)
    hand.press(LEFT)
    assert hand().tolist() == [0.0, 0.5]
    hand.end()
    hand.press(FORWARD)
    assert hand() == Stop("ended by hand")


@pytest.fixture(params=[True, False], ids=["known starts", "unknown starts"])
def shown(request):
    """A page after its start: server, hand, environment, and what stands beside."""
    server, hand = RecordedServer(), Hand()
    beside = "tour_frontier", [(0.0, 0.1), (2.0, 0.4), (4.0, 0.6)]
    view = DrivenView(server, ByHand(hand), "by_hand", hand, beside=beside)
    settings = make_settings(robots=1, known_starts=request.param, **SETTINGS)
    env = WatchedExploration("apartment", settings, watchers=[view])
    env.use_level("velocity")
    env.reset(seed=5)
    return SimpleNamespace(server=server, hand=hand, env=env, view=view)


def test_all_keys_and_buttons_are_on_the_page_and_do_as_they_say(shown):
    controls = shown.server.gui.controls
    for what, keys in KEYS.items():
        shown.hand.press(HALT)
        controls[what].press()
        pressed = shown.hand().tolist()
        for key in keys:
            shown.hand.press(HALT)
            controls[f"key {key}"].press()
            assert shown.hand().tolist() == pressed
    assert controls["Speed"].value == "1 x"


def test_a_click_on_the_ground_leads_there(shown):
    there = shown.env.world.poses[0, :2] + np.array([0.4, 0.3])
    # A ray from 5 m above and behind.
    origin = np.array([there[0] - 2.0, there[1], 5.0])
    shown.server.scene.clicked(SimpleNamespace(ray_origin=origin, ray_direction=np.array([2.0, 0.0, -5.0])))
    goal = shown.hand()
    start, point = shown.env.world.starts[0], np.array([goal.x, goal.y]) + shown.env.perception.poses.offset(0)
    if not shown.env.settings.known_starts:
        cosine, sine = np.cos(start[2]), np.sin(start[2])
        point = np.array([[cosine, -sine], [sine, cosine]]) @ point + start[:2]
    np.testing.assert_allclose(point, there, atol=1e-9)
    shown.hand.press(HALT)
    shown.server.scene.clicked(SimpleNamespace(ray_origin=origin, ray_direction=np.array([0.0, 0.0, 1.0])))
    assert shown.hand().tolist() == [0.0, 0.0]


def test_the_coverage_of_the_other_policy_stands_beside_the_own(shown):
    def said():
        shown.view._draw_maps()
        return next(control.content for name, control in shown.server.gui.controls.items() if name == "html 0")

    assert '<td>tour_frontier</td><td style="text-align:right;white-space:nowrap">10.0 %' in said()
    for _ in range(25):
        shown.env.step({"robot_0": np.zeros(2, np.float32)})
    assert ">40.0 %<" in said()


def test_the_robot_is_driven_until_the_run_ends(shown):
    shown.server.gui.controls[FORWARD].press()
    policy = ByHand(shown.hand)
    policy.reset(shown.env)
    observations = {"robot_0": None}
    while shown.env.agents:
        observations = shown.env.step(policy.act(observations))[0]
    assert shown.env.world.travelled[0] > 0.3
