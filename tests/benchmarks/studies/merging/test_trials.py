import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, about_middle, apartment, blank, moved, room

from lidarium.benchmarks.studies.merging import figures
from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.floors import BankFloor
from lidarium.benchmarks.studies.merging.peers import features_of, match_peers
from lidarium.benchmarks.studies.merging.trials import SIDE, Outcome, padded, read_outcomes, try_pairs
from lidarium.mapping.geometry.rigid import Transform

FIRST, SECOND = about_middle(0.4, apartment()), about_middle(-1.3, apartment())
FLOOR = BankFloor("drawn", "test", "drawn")


def bank_map(key, levels):
    return BankMap(key, FLOOR, 0, 0, levels, Transform())


def bank():
    """Two views of an apartment and a room; the cells are taken for those of the bank."""
    maps = {
        "a": bank_map("a", moved(apartment(), FIRST)),
        "b": bank_map("b", moved(apartment(), SECOND)),
        "c": bank_map("c", room(blank(), 20, 20, 90, 130)),
    }
    true = FIRST @ SECOND.inverse()
    pose = (true.x / 2.0, true.y / 2.0, true.theta)
    return maps, [
        Pair("a", "b", "test", "positive", 1.0, pose, (4.0, 4.0)),
        Pair("a", "c", "test", "negative"),
    ]


def outcome(is_accepted, distance=None, angle=None, confidence=1.0, time_ms=10.0):
    return Outcome(is_accepted, "", distance, angle, "corners", confidence, time_ms, True)


def test_the_peers_find_the_motion_of_a_turned_map():
    a, b = (features_of(moved(apartment(), pose), "orb") for pose in (FIRST, SECOND))
    result = match_peers(a, b, RESOLUTION)
    assert result.a_from_b is not None
    distance, angle = result.a_from_b.difference(FIRST @ SECOND.inverse(), (8.0, 8.0))
    assert distance < 0.3
    assert angle < math.radians(2.0)
    assert result.scale == pytest.approx(1.0, abs=0.05)
    nothing = features_of(np.full((50, 50), 127, np.uint8), "orb")
    assert match_peers(a, nothing, RESOLUTION).a_from_b is None


@pytest.mark.parametrize("method", ["default", "orb"])
def test_outcomes_are_kept_and_gone_on_with(tmp_path, method):
    maps, pairs = bank()
    assert list(try_pairs(tmp_path, maps, pairs, method, 1)) == [0, 2]
    assert list(try_pairs(tmp_path, maps, pairs, method, 1)) == [2]
    joined, other = read_outcomes(tmp_path, pairs, method)
    assert joined.is_accepted
    assert joined.is_standard
    assert joined.time_ms > 0.0
    assert other.distance_m is None
    if method == "default":
        assert joined.is_exact
        assert not other.is_accepted
    with pytest.raises(ValueError, match="method is 'magic'"):
        next(try_pairs(tmp_path, maps, pairs, "magic", 1))


def test_small_maps_are_padded_and_large_ones_left():
    assert padded(np.zeros((3, 700), np.uint8)).shape == (SIDE, 700)
    assert np.count_nonzero(padded(np.zeros((3, 7), np.uint8)) == 0) == 21


def test_figures_count_what_they_say():
    plenty, little = Pair("a", "b", "test", "positive", 0.5), Pair("a", "b", "test", "positive", 0.2)
    negative, alike, symmetric = (Pair("a", "b", "test", name) for name in ("negative", "look_alike", "symmetric"))
    tried = [
        (plenty, outcome(True, 0.02, 0.001, confidence=0.9)),
        (plenty, outcome(True, 0.3, 0.001)),
        (plenty, outcome(False, 0.01, 0.0)),
        (little, outcome(True, 0.8, 0.0)),
        (negative, outcome(True, confidence=0.95)),
        (alike, outcome(False)),
        (symmetric, outcome(False)),
        (Pair("a", "b", "test", "refurnished", 0.5), outcome(True, 0.01, 0.0, confidence=0.5)),
    ]
    assert figures.recall(tried, figures.is_plenty).hits == 2
    assert figures.recall(tried, figures.is_plenty).total == 4
    assert figures.recall(tried, figures.is_refurnished).value == 1.0
    assert figures.safe_threshold(tried) == 0.95
    assert figures.safe_threshold(tried, ("look_alike",)) == 0.0
    assert figures.accepted(tried, ("negative",), above=0.95).hits == 0
    assert figures.recall(tried, figures.is_plenty, above=0.95).hits == 0
    assert figures.recall(tried, figures.is_little).value == 0.0
    assert str(figures.accepted(tried, figures.NEGATIVE)).startswith("50.0 % (1 of 2")
    assert figures.refused(tried, figures.UNDECIDABLE).value == 1.0
    assert figures.wrong_positives(tried).hits == 1
    assert figures.errors(tried)[0] == pytest.approx(0.16)
    assert figures.times(tried).median == 10.0
    assert figures.times([]).count == 0


def test_no_hits_of_many_bound_the_rate_from_above():
    share = figures.Share(0, 500)
    assert share.high == pytest.approx(1.0 - 0.05 ** (1.0 / 500.0))
    assert share.low == 0.0
    assert figures.Share(5, 5).high == 1.0
    assert str(figures.Share(0, 0)) == "-"
