"""Tours of a team that knows the floor are drawn with what they come to."""

import math

import cv2
import numpy as np
import pytest
from linked_rooms import TWO_ROOMS, settings_of

from lidarium.evaluation.bounds.bound import KnownFloorBound, Walk
from lidarium.evaluation.drawing import bound_picture


@pytest.mark.parametrize(("time_s", "words"), [(12.4, "12 s"), (math.inf, "not in time")])
def test_the_title_says_how_much_was_seen_and_when(tmp_path, monkeypatch, time_s, words):
    titles, save = [], bound_picture.save_titled_figure

    def noting(path, figure, *given):
        titles.append(given)
        save(path, figure, *given)

    monkeypatch.setattr(bound_picture, "save_titled_figure", noting)
    walk = Walk(np.array([(1.0, 2.0), (6.0, 2.0)]), np.zeros(2), np.array([math.nan, 1.0]))
    bound = KnownFloorBound(time_s, 5.0, 5.0, 0.987, [walk])
    bound_picture.save_bound_picture(tmp_path / "a.png", TWO_ROOMS, settings_of(), bound, "two $rooms")
    assert titles == [("two $rooms", f"a team that knows the floor: 98.7 % seen, {words}, 5 m")]
    assert cv2.imread(str(tmp_path / "a.png")).shape[1] > 600
