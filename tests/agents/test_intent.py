"""The target of a robot, and how firmly it is kept."""

import numpy as np

from lidarium.agents.intent import KEPT, KEPT_NEAR, MAX_RETURNS, Intent

LEFT, RIGHT = np.array([0.0, 0.0]), np.array([4.0, 0.0])


def test_what_is_gone_for_first_is_kept_for_the_least_gain():
    intent = Intent()
    intent.go_for(LEFT)
    intent.go_for(RIGHT)
    assert intent.kept == KEPT


def test_each_return_to_what_was_left_doubles_the_gain():
    intent = Intent()
    for focus, kept in ((LEFT, 1.0), (RIGHT, 1.0), (LEFT, 2.0), (RIGHT, 4.0)):
        intent.go_for(focus)
        assert intent.kept == kept * KEPT


def test_what_is_near_is_the_same():
    intent = Intent()
    for step in range(4):
        intent.go_for(LEFT + np.array([0.9 * KEPT_NEAR * (step % 2), 0.0]))
    assert intent.kept == KEPT


def test_what_is_settled_counts_no_more():
    intent = Intent()
    for focus in (LEFT, RIGHT, LEFT):
        intent.go_for(focus)
    intent.settle()
    assert intent.kept == KEPT
    intent.go_for(RIGHT)
    assert intent.kept == KEPT


def test_nothing_to_go_for_is_no_return():
    intent = Intent()
    for focus in (LEFT, None, LEFT, None, RIGHT):
        intent.go_for(focus)
    assert intent.kept == KEPT


def test_the_gain_stays_a_number_however_often_a_robot_returns():
    intent = Intent()
    for _ in range(1200):
        intent.go_for(LEFT)
        intent.go_for(RIGHT)
    assert intent.kept == KEPT * 2.0**MAX_RETURNS
