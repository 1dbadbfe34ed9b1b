"""Maps that grow are described as far as they have changed."""

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, kept

from lidarium.mapping.merging.growing_maps import DescribedMaps, GrowingMap
from lidarium.mapping.merging.settings import MergeSettings

SETTINGS = MergeSettings()


def taken_in(maps, number, into=None):
    into = into or DescribedMaps()
    into.update(maps, RESOLUTION, SETTINGS, number)
    return into


def test_only_what_has_changed_is_described_again():
    known = taken_in(
        {"a": GrowingMap(apartment()), "b": GrowingMap(kept(apartment(), slice(0, 80), slice(0, 90)))}, 1
    )
    before = dict(known.features)
    taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 2, known)
    assert known.features["a"] is before["a"]
    assert known.features["b"] is not before["b"]
    assert known.changed_at == {"a": 1, "b": 2}


def test_a_map_whose_corner_has_moved_has_changed():
    known = taken_in({"a": GrowingMap(apartment())}, 1)
    taken_in({"a": GrowingMap(apartment(), (0.0, RESOLUTION))}, 2, known)
    assert known.changed_at == {"a": 2}
    assert known.maps["a"].origin == (0.0, RESOLUTION)


def test_the_known_area_counts_all_cells_but_unknown_ones():
    levels = np.full((10, 20), 127, np.uint8)
    levels[:5, :10], levels[5, :4] = 255, 0
    known = taken_in({"a": GrowingMap(levels)}, 1)
    assert known.known_m2["a"] == pytest.approx(54 * RESOLUTION**2)


def test_a_map_that_is_missing_is_forgotten():
    known = taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 1)
    taken_in({"b": GrowingMap(apartment())}, 2, known)
    assert list(known.features) == list(known.maps) == ["b"]
    taken_in({"a": GrowingMap(apartment()), "b": GrowingMap(apartment())}, 3, known)
    assert known.changed_at == {"a": 3, "b": 1}


def test_what_is_no_map_is_refused_and_what_was_known_is_kept():
    known = taken_in({"a": GrowingMap(apartment())}, 1)
    features, area = known.features["a"], known.known_m2["a"]
    with pytest.raises(ValueError, match="shape"):
        taken_in({"a": GrowingMap(np.zeros((0, 4), np.uint8)), "b": GrowingMap(apartment())}, 2, known)
    assert known.features == {"a": features}
    assert (known.known_m2, known.changed_at) == ({"a": area}, {"a": 1})
    assert np.array_equal(known.maps["a"].levels, apartment())
