"""Where robots are sent by orders, until they are done or cannot be."""

from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.agents.policy import Stop
from lidarium.agents.supervisor.errands import LOST_S, PATIENCE_S, Errands
from lidarium.agents.supervisor.supervisor import Command
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.radio.messages import DriveState, OrderKind, Target


def known_up_to(column):
    """A map of 4 m by 4 m that is free up to a column and unknown beyond."""
    log_odds = np.zeros((40, 40), np.int8)
    log_odds[:, :column] = -40
    navigation = NavigationMap(log_odds, 0.1)
    navigation.changed((0, 40, 0, 40))
    return navigation


class Robots:
    """A team of one robot, made by hand."""

    def __init__(self):
        self.time_s, self.state, self.taken = 10.0, DriveState.DRIVING, None
        self.place, self.map = (1.0, 2.0), known_up_to(20)

    def belief(self, agent):
        return SimpleNamespace(
            pose=np.array([*self.place, 0.0]), map=self.map, shared_map=None, map_origin=(0.0, 0.0)
        )

    def drive_state(self, agent):
        return self.state

    def last_order(self, agent):
        return self.taken


def sent(**changes):
    """A robot that has been sent to a frontier, and has taken the order."""
    team = Robots()
    errands = Errands(team)
    values = {"agent": "a", "kind": OrderKind.GO_TO, "rule": 3, "why": "because"}
    errands.begin(Command(**{**values, "target": Target(1.9, 2.0), "observes": (2.0, 2.0), **changes}))
    order = errands.action("a")
    team.taken = order
    errands.review("a")
    return team, errands, order


def test_a_robot_gets_its_order_once_and_is_away():
    _, errands, order = sent()
    assert (order.kind, order.target, order.reason) == (OrderKind.GO_TO, Target(1.9, 2.0), "rule 3: because")
    assert errands.is_away("a")
    assert errands.action("a") is None
    errands.cancel("a")
    assert not errands.is_away("a")
    assert len(errands) == 0
    errands.cancel("a")


def test_a_command_without_a_target_is_no_errand():
    errands = Errands(Robots())
    errands.begin(Command("a", OrderKind.PAUSE, 1, "wait"))
    assert len(errands) == 0


@pytest.mark.parametrize(("after_s", "is_left"), [(LOST_S, 1), (LOST_S + 0.1, 0)])
def test_an_order_that_was_not_taken_is_lost_after_a_while(after_s, is_left):
    team = Robots()
    errands = Errands(team)
    errands.begin(Command("a", OrderKind.GO_TO, 3, "because", Target(1.9, 2.0)))
    errands.action("a")
    # Until it has taken the order its policy drives it.
    assert not errands.is_away("a")
    team.time_s += after_s
    errands.review("a")
    assert len(errands) == is_left


@pytest.mark.parametrize("state", [DriveState.ARRIVED, DriveState.NO_PATH])
def test_an_errand_ends_where_the_robot_is_there_or_cannot_come(state):
    team, errands, _ = sent()
    team.state = state
    errands.review("a")
    assert not errands.is_away("a")


def test_an_errand_ends_where_nothing_is_left_to_see():
    team, errands, _ = sent()
    errands.review("a")
    assert errands.is_away("a")
    team.map = known_up_to(40)
    errands.review("a")
    assert not errands.is_away("a")


def test_a_robot_that_does_not_move_explores_by_itself_again_unless_it_gives_way():
    team, errands, _ = sent()
    for state, place in ((DriveState.GIVING_WAY, (1.0, 2.0)), (DriveState.DRIVING, (1.3, 2.0))):
        team.time_s += PATIENCE_S
        team.state, team.place = state, place
        errands.review("a")
        assert errands.is_away("a")
    team.time_s += PATIENCE_S + 0.1
    errands.review("a")
    assert not errands.is_away("a")


@pytest.mark.parametrize(
    ("state", "reason"), [(DriveState.ARRIVED, "returned"), (DriveState.NO_PATH, "unreachable")]
)
def test_a_robot_that_is_sent_home_ends_there(state, reason):
    team, errands, _ = sent(is_home=True, observes=None)
    team.time_s += 10.0 * PATIENCE_S
    errands.review("a")
    assert errands.action("a") is None
    errands.begin(Command("a", OrderKind.GO_TO, 9, "again", Target(0.0, 0.0), is_home=True))
    assert errands.action("a") is None
    team.state = state
    errands.review("a")
    assert errands.action("a") == Stop(reason)
