"""Many decisions as arrays."""

from dataclasses import fields

import numpy as np
from drawn_decisions import drawn_decision

from lidarium.training.decisions import MOST_OPTIONS, MOST_TEAMMATES, Decisions, stacked


def drawn(shapes, seed=0):
    generator = np.random.default_rng(seed)
    return [drawn_decision(generator, *shape) for shape in shapes]


def test_each_row_holds_its_decision_and_zeros():
    decisions = drawn([(3, 0), (14, 8), (5, 2)])
    table = stacked(decisions)
    assert len(table) == 3
    for k, decision in enumerate(decisions):
        n, m = len(decision.options), len(decision.teammates)
        assert table.counts[k].tolist() == [n, m]
        for name in ("options", "crops", "scores", "mask"):
            rows = getattr(table, name)[k]
            np.testing.assert_array_equal(rows[:n], getattr(decision, name))
            assert not rows[n:].any()
            assert rows.dtype == getattr(decision, name).dtype
        np.testing.assert_array_equal(table.teammates[k, :m], decision.teammates)
        assert not table.teammates[k, m:].any()
        np.testing.assert_array_equal(table.situation[k], decision.situation)


def test_no_decisions_are_a_table_of_no_rows():
    table = stacked([])
    assert len(table) == 0
    assert table.options.shape[1] == MOST_OPTIONS
    assert table.teammates.shape[1] == MOST_TEAMMATES


def test_rows_are_taken_in_their_order():
    table = stacked(drawn([(4, 1)] * 5))
    rows = np.array([3, 0, 3])
    taken = table.take(rows)
    assert len(taken) == 3
    for field in fields(Decisions):
        np.testing.assert_array_equal(getattr(taken, field.name), getattr(table, field.name)[rows])
