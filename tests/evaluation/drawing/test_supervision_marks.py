"""Marks of a supervisor's decisions on pictures and films."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from seen_truth import NEAR, begun

from lidarium.agents import Policy
from lidarium.agents.report import GivenOrder, Join, PolicyReport, Supervision
from lidarium.envs.drawing.frame_parts import view_around
from lidarium.envs.onboard.radio.messages import OrderKind
from lidarium.evaluation.drawing.supervision_marks import draw_supervision, recent_supervision
from lidarium.mapping.geometry.rigid import Transform


class Led(Policy):
    """Reports what a station is said to have done."""

    level = "waypoint"

    def __init__(self, supervision):
        self.supervision = supervision

    def reset(self, team, seed):
        pass

    def act(self, observations):
        return {}

    def report(self):
        return PolicyReport((), self.supervision)


def join(is_used, time_s=0.0):
    return Join(time_s, "robot_0", "robot_1", Transform(), (1.0, 0.0), is_used)


def order(kind, goal=None, time_s=0.0):
    return GivenOrder(time_s, "robot_1", kind, (0.0, 0.0), goal)


@pytest.fixture
def env():
    return begun(known_starts=False)


def test_without_a_station_nothing_is_marked(env):
    axes = Figure().subplots()
    assert draw_supervision(axes, env, Led(None).report()) == []
    assert not axes.has_data()


def test_marks_stand_in_the_frame_of_the_floor(env):
    axes = Figure().subplots()
    orders = [order(OrderKind.STOP), order(OrderKind.GO_TO, (2.0, 0.0))]
    station = Supervision(joins=[join(True), join(False)], orders=orders)
    labels = [entry.get_label() for entry in draw_supervision(axes, env, Led(station).report())]
    assert labels == ["redirected", "stopped by the supervisor", "maps joined"]
    stopped, joined = (line.get_xydata()[0] for line in axes.lines)
    x, y, theta = NEAR[1]
    assert stopped == pytest.approx((x, y))
    assert joined == pytest.approx((x + np.cos(theta), y + np.sin(theta)))
    (arrow,) = axes.texts
    assert arrow.xy == pytest.approx((x + 2.0 * np.cos(theta), y + 2.0 * np.sin(theta)))


@pytest.mark.parametrize(("ago_s", "is_shown"), [(3.5, True), (4.5, False)])
@pytest.mark.parametrize("what", ["orders", "joins"])
def test_a_film_shows_what_is_recent(env, ago_s, is_shown, what):
    view = view_around(np.ones((200, 200), bool), env.world.floors[0].laser.origin, 0.05, 400)
    frame = np.zeros((view.height, view.width, 3), np.uint8)
    done = {"orders": [order(OrderKind.GO_TO, (1.0, 0.0), -ago_s)], "joins": [join(True, -ago_s)]}
    recent_supervision(Led(Supervision(**{what: done[what]})))(env, frame, view)
    assert env.scorer.time == 0.0
    assert frame.any() == is_shown
