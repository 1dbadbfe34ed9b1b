"""What two overlaid maps say for and against their transform."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment

from lidarium.mapping.files.map_files import FREE
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.validation import Agreement, ValidationSettings, compare, why_refused
from lidarium.mapping.merging.description.described_map import describe_map


def test_the_score_of_a_map_with_itself_is_one():
    a = describe_map(apartment(), RESOLUTION)
    same = compare(a, a, Transform(), ValidationSettings())
    assert (same.score, same.hit_rate, same.contradicting_m) == (1.0, 1.0, 0.0)
    assert why_refused(same, ValidationSettings()) is None
    shifted = compare(a, a, Transform(0.5, 0.0, 0.0), ValidationSettings())
    assert shifted.score < 0.9
    assert "contradiction" in str(why_refused(shifted, ValidationSettings()))


def test_walls_at_the_rim_of_what_a_map_knows_do_not_contradict():
    unseen = apartment()
    unseen[8:10, 30:60] = 127
    a, b = describe_map(apartment(), RESOLUTION), describe_map(unseen, RESOLUTION)
    found = compare(a, b, Transform(0.0, -0.05, 0.0), ValidationSettings())
    assert found.contradicting_m == 0.0
    in_the_open = compare(a, b, Transform(0.0, -0.3, 0.0), ValidationSettings())
    assert in_the_open.contradicting_m > 1.0


def test_what_speaks_against_a_transform_weighs_more_than_what_speaks_for_it():
    settings = ValidationSettings()
    weak = Agreement(
        overlap_m2=6.0, agreeing_m=5.2, wall_m=6.0, across_m=1.3, contradicting_m=0.1, score=0.98
    )
    assert weak.evidence_m == pytest.approx(5.2 - 0.8 - 0.3)
    assert why_refused(weak, settings) is None
    assert "small overlap" in str(why_refused(replace(weak, wall_m=6.8), settings))
    assert "contradiction" in str(why_refused(replace(weak, contradicting_m=0.2), settings))


def test_corridors_and_halls_can_be_asked_for_more():
    settings = ValidationSettings(least_across_share=0.15, least_evidence_per_m2=0.3)
    room_like = Agreement(overlap_m2=20.0, agreeing_m=15.0, wall_m=15.5, across_m=6.0, score=1.0)
    assert why_refused(room_like, settings) is None
    assert "in one direction" in str(why_refused(replace(room_like, across_m=1.0), settings))
    assert "want 15" in str(why_refused(replace(room_like, overlap_m2=50.0), settings))
    assert why_refused(replace(room_like, across_m=1.0, overlap_m2=50.0), ValidationSettings()) is None


def test_what_drift_explains_is_excused_where_both_maps_know_a_building():
    furnished = Agreement(
        overlap_m2=150.0, agreeing_m=260.0, wall_m=265.0, across_m=120.0, contradicting_m=1.4, score=0.998
    )
    assert "contradiction" in str(why_refused(furnished, ValidationSettings()))
    assert why_refused(replace(furnished, overlap_m2=300.0), ValidationSettings()) is None


def test_the_overlap_and_its_middle_are_measured():
    a, b = (
        describe_map(np.full((60, 60), FREE, np.uint8), 0.1),
        describe_map(np.full((60, 60), FREE, np.uint8), 0.1),
    )
    found = compare(a, b, Transform(3.0, 0.0, 0.0), ValidationSettings())
    assert found.overlap_m2 == pytest.approx(18.0, rel=0.05)
    assert found.centre == pytest.approx((1.5, 3.0), abs=0.1)
