"""Robots that the rest of the floor does not need leave options to those that are nearer."""

from types import SimpleNamespace

import numpy as np

from lidarium.agents.predicted.planning import Rest, extra_costs


def rest_of(robots, options, stops, shown):
    """Return the rest of a one-dimensional floor; ``shown`` has a row of stops for each option."""
    robots, options, stops = (np.array(each, np.float64) for each in (robots, options, stops))

    def apart(first, second):
        return np.abs(first[:, None] - second[None])

    tour_options = SimpleNamespace(
        first=apart(robots, options),
        is_reached=np.ones((len(robots), len(options)), np.bool_),
        is_kept=np.zeros((len(robots), len(options)), np.bool_),
    )
    left = 1.0 - np.array(shown, np.float64)
    return Rest(tour_options, apart(robots, stops), apart(options, stops), apart(stops, stops), left)


def test_a_robot_without_a_tour_stays_if_nothing_is_saved():
    rest = rest_of([0.0, 9.0], [10.0], [10.0, 11.0], [[1, 1]])
    assert np.isinf(extra_costs(rest, 0, None, [])).all()


def test_a_robot_without_a_tour_goes_if_that_saves_much():
    rest = rest_of([0.0, 1.0], [-10.0, 10.0], [-10.0, -11.0, 10.0, 11.0], [[1, 1, 0, 0], [0, 0, 1, 1]])
    assert np.argmin(extra_costs(rest, 0, None, [])) == 0


def test_of_options_that_the_rest_does_not_need_the_nearest_is_taken():
    rest = rest_of([0.0, 20.0], [5.0, 3.0, 21.0], [22.0, 24.0], [[0, 0], [0, 0], [0, 0]])
    assert np.argmin(extra_costs(rest, 0, 2, [2])) == 1  # its own option is gone
