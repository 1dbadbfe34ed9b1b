import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from lidarium.evaluation.statistics import holm, sign_test, wilcoxon_test

A, B = np.random.default_rng(4).normal(size=(2, 40))


def test_wilcoxon_is_scipys_and_says_how_many_pairs_it_has():
    found = wilcoxon_test(A, B)
    assert found.p_value == stats.wilcoxon(A, B).pvalue
    assert (found.size, found.less + found.greater, found.ties) == (40, 40, 0)


def test_ties_are_told_and_left_out():
    found = wilcoxon_test(np.append(A, [1.0, 2.0]), np.append(B, [1.0, 2.0]))
    assert (found.size, found.ties) == (42, 2)
    assert found.p_value == wilcoxon_test(A, B).p_value


def test_eight_of_nine_wins_have_the_p_value_of_coins():
    found = sign_test([1] * 8 + [3, 2], [2] * 8 + [2, 2])
    assert (found.less, found.greater, found.ties) == (8, 1, 1)
    assert found.p_value == pytest.approx(20 / 512)


def test_pairs_that_are_all_equal_say_nothing():
    for test in (wilcoxon_test, sign_test):
        found = test([1.0, 2.0], [1.0, 2.0])
        assert (found.p_value, found.ties) == (1.0, 2)


def test_a_clear_difference_is_found_by_both():
    assert wilcoxon_test(A + 3.0, B).p_value < 1e-6
    assert sign_test(A + 3.0, B).p_value < 1e-6


def test_holms_own_way_of_counting():
    assert holm([0.01, 0.04, 0.03, 0.005]).tolist() == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.5, 0.9]).tolist() == [1.0, 1.0]


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_raises_p_values_keeps_their_order_and_is_at_most_bonferroni(p_values):
    corrected = holm(p_values)
    assert (corrected >= np.array(p_values)).all()
    assert (corrected <= np.minimum(len(p_values) * np.array(p_values), 1.0) + 1e-12).all()
    assert (np.diff(corrected[np.argsort(p_values, kind="stable")]) >= 0.0).all()


@pytest.mark.parametrize("p_values", [[], [1.2], [-0.1], [np.nan]])
def test_bad_p_values_are_refused(p_values):
    with pytest.raises(ValueError, match="p_values"):
        holm(p_values)


@pytest.mark.parametrize("test", [wilcoxon_test, sign_test])
def test_bad_pairs_are_refused(test):
    with pytest.raises(ValueError, match="a has 2 values and b has 1"):
        test([1.0, 2.0], [1.0])
    with pytest.raises(ValueError, match="a are empty"):
        test([], [])


def test_rounding_is_no_difference_and_ties_share_their_ranks():
    found = wilcoxon_test([0.1 + 0.2] * 7, [0.3] * 7)
    assert (found.p_value, found.ties) == (1.0, 7)
    a = np.array([83.0, 48.2, 119.7, 61.4, 50.1, 70.0])
    b = a + np.array([1.1, 1.1, 1.1, -24.3, 1.1, -1.1])
    wanted = stats.wilcoxon([-1.0, -1.0, -1.0, 2.0, -1.0, 1.0], method=stats.PermutationMethod(np.inf)).pvalue
    assert wilcoxon_test(a, b).p_value == pytest.approx(wanted)


def test_many_pairs_are_tested_by_the_normal_distribution():
    a, b = np.random.default_rng(5).normal(size=(2, 60))
    assert wilcoxon_test(a, b).p_value == pytest.approx(stats.wilcoxon(a, b, method="approx").pvalue)
