"""Maps are compared once one of them is bent onto the other."""

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, bowed, hall, sagging

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.agreement.validation import ValidationSettings, compare
from lidarium.mapping.merging.bend.bent_agreement import BLUNT_M, SHARP_M, compare_bent, tolerance
from lidarium.mapping.merging.bend.estimation import Bend
from lidarium.mapping.merging.bend.offset_field import OffsetField
from lidarium.mapping.merging.description.described_map import describe_map


def bend_of(offsets, pose=(0.0, 0.0, 0.0)):
    field = OffsetField((0.0, 0.0), 1.0, np.asarray(offsets, np.float64))
    return Bend(Transform(*pose), field, 0.0, 0.0, 0.01, 1.0, np.eye(3))


def test_the_tolerance_grows_with_the_spread_between_two_limits():
    straight = bend_of(np.zeros((2, 2, 2)))
    found = [tolerance(replace(straight, spread_m=spread), 0.025)[0] for spread in (0.0, 0.04, 1.0)]
    assert found == pytest.approx([SHARP_M, 0.1, BLUNT_M])
    assert tolerance(straight, 0.2)[0] == pytest.approx(0.3)
    for resolution in (0.025, 0.1, 0.4):
        hit, miss = tolerance(straight, resolution)
        assert hit < miss


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.2, -0.1, 0.05)])
def test_maps_without_bend_agree_as_rigid_ones_do(pose):
    one = describe_map(apartment(), RESOLUTION)
    rigid = compare(one, one, Transform(*pose), ValidationSettings())
    bent = compare_bent(one, one, bend_of(np.zeros((3, 3, 2)), pose))
    assert bent.overlap_m2 == rigid.overlap_m2
    assert bent.agreeing_m == pytest.approx(rigid.agreeing_m, abs=0.2)
    assert bent.contradicting_m == pytest.approx(rigid.contradicting_m, abs=0.2)


def test_a_bowed_map_agrees_only_once_its_bow_is_undone():
    length = hall().shape[1] * RESOLUTION
    a, b = (describe_map(levels, RESOLUTION) for levels in (hall(), bowed(hall(), 0.4)))
    rows, columns = math.ceil(hall().shape[0] * RESOLUTION) + 1, math.ceil(length) + 1
    nodes = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(float)
    offsets = -sagging(nodes, 0.4, length).reshape(rows, columns, 2)
    rigid = compare_bent(a, b, bend_of(np.zeros_like(offsets)))
    bent = compare_bent(a, b, bend_of(offsets))
    assert rigid.hit_rate < 0.7
    assert bent.hit_rate > 0.95
    assert bent.contradicting_m < 0.1 * rigid.contradicting_m
