"""Orders that a robot takes are such that it can."""

import math

import numpy as np
import pytest

from lidarium.envs.onboard.radio.messages import MOST_POINTS, OperatingState, Order, OrderKind, Orders, Route, Target


def test_orders_of_a_list_are_arrays_over_rows():
    orders = Orders.of([Target(1.0, 2.0), None, Target(3.0, 4.0, 0.5)])
    assert orders.is_ordered.tolist() == [True, False, True]
    assert orders.targets.tolist() == [[1.0, 2.0], [0.0, 0.0], [3.0, 4.0]]
    assert np.isnan(orders.headings).tolist() == [True, True, False]
    assert orders.headings[2] == 0.5
    assert Orders.of([]).targets.shape == (0, 2)


def test_a_route_ends_at_its_target():
    route = Route(np.array([(0.0, 0.0), (1.0, 2.0)]), np.zeros(2), 0.25)
    assert route.target == Target(1.0, 2.0, 0.25)


def test_a_kind_of_order_may_be_named():
    assert Order("stop", reason="late").kind is OrderKind.STOP
    assert Order("go_to", Target(0.0, 0.0)).target == Target(0.0, 0.0)


POINTS = np.zeros((2, 2))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Target(math.nan, 0.0), "want finite metres"),
        (lambda: Target(0.0, 0.0, math.inf), "heading of the target is inf"),
        (lambda: Route(POINTS[:0], np.zeros(0)), "points of the route have shape"),
        (lambda: Route(np.zeros((MOST_POINTS + 1, 2)), np.zeros(MOST_POINTS + 1)), "with 1 to 512"),
        (lambda: Route(POINTS, np.zeros(3)), "room of the route has shape"),
        (lambda: Route(POINTS, np.full(2, np.inf)), "are not finite"),
        (lambda: Route(POINTS, np.zeros(2), math.nan), "heading of the route is nan"),
        (lambda: Order("fly"), "kind of the order is 'fly'; want one of pause, resume"),
        (lambda: Order("go_to"), "want a Target, the place to go to"),
        (lambda: Order("stop", Target(0.0, 0.0)), "only 'go_to' has a target"),
        (lambda: OperatingState("asleep"), "operating state is 'asleep'; want one of operating"),
    ],
)
def test_what_no_robot_can_do_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
