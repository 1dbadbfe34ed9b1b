import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.association import Way, are_near, common_places, join, overlap_of
from lidarium.mapping.splines.bspline import Spline
from lidarium.mapping.splines.fitting import fit_bspline
from lidarium.mapping.splines.settings import AssociationSettings, MapSettings


def along(first, last, y=0.0):
    """A straight curve along x from ``first`` to ``last``."""
    return fit_bspline(np.stack([np.linspace(first, last, 30), np.full(30, y)], axis=1)).spline


@pytest.mark.parametrize(
    ("seen", "seen_part", "known_part", "cases"),
    [
        ((1.0, 3.0), (0.0, 2.0), (1.0, 3.0), (False, False)),
        ((-1.0, 2.0), (1.0, 3.0), (0.0, 2.0), (True, False)),
        ((2.0, 5.0), (0.0, 2.0), (2.0, 4.0), (False, True)),
        ((-1.0, 5.0), (1.0, 5.0), (0.0, 4.0), (True, True)),
    ],
)
def test_the_overlap_is_bounded_by_whichever_curve_ends_first(seen, seen_part, known_part, cases):
    overlap = overlap_of(along(*seen, y=0.03), along(0.0, 4.0))
    np.testing.assert_allclose(overlap.seen, seen_part, atol=1e-6)
    np.testing.assert_allclose(overlap.known, known_part, atol=1e-6)
    assert (overlap.begins_at_known, overlap.ends_at_known) == cases
    assert overlap.length == pytest.approx(seen_part[1] - seen_part[0])
    assert overlap.distance == pytest.approx(0.03)
    assert overlap.turn == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
@settings(max_examples=40)
def test_the_overlap_does_not_depend_on_where_both_curves_are(x, y, theta):
    move = Transform(x, y, theta)
    seen, known = along(-1.0, 2.0, 0.04), along(0.0, 4.0)
    here = overlap_of(seen, known)
    there = overlap_of(*(Spline(curve.knots, move.apply(curve.control_points)) for curve in (seen, known)))
    np.testing.assert_allclose(
        (*here.seen, *here.known, here.distance), (*there.seen, *there.known, there.distance), atol=1e-6
    )


@pytest.mark.parametrize(
    "seen",
    [
        lambda: along(1.0, 3.0, 0.15),
        lambda: along(3.9, 6.0),
        lambda: along(4.5, 6.0),
        lambda: fit_bspline([(3, 0), (2, 0), (1.5, 0), (1, 0)]).spline,
        lambda: fit_bspline([(1, 0), (1.1, 0.1), (1.2, 0.2), (1.3, 0.3)]).spline,
    ],
)
def test_curves_apart_short_of_overlap_opposite_or_across_are_not_of_one_wall(seen):
    assert overlap_of(seen(), along(0.0, 4.0)) is None


def test_the_rough_step_looks_at_control_points():
    assert are_near(np.array([(0.0, 0.0), (1.0, 0.0)]), np.array([(1.0, 0.25)]), 0.3)
    assert not are_near(np.array([(0.0, 0.0), (1.0, 0.0)]), np.array([(1.0, 0.35)]), 0.3)


def way(first, last, y=0.0, weight=1.0):
    return Way(along(first, last, y).sample(0.05), np.full(len(along(first, last, y).sample(0.05)), weight))


def test_joined_curves_are_their_weighted_mean_where_both_run():
    seen, known = way(1.0, 3.0, 0.04, weight=1.0), way(0.0, 4.0, 0.0, weight=3.0)
    joined, extends = join(seen, known, common_places(seen, known, AssociationSettings()), MapSettings())
    assert not extends
    # Towards the ends of the seen curve its share fades, so that there is no step where the known one goes on
    # alone.
    middle = (joined.points[:, 0] > 1.5) & (joined.points[:, 0] < 2.5)
    np.testing.assert_allclose(joined.points[middle, 1], 0.01, atol=1e-9)
    np.testing.assert_allclose(joined.weights[middle], 4.0)
    np.testing.assert_allclose(joined.points[[0, -1], 0], (0.0, 4.0))
    np.testing.assert_allclose(joined.weights[[0, -1]], 3.0)


@pytest.mark.parametrize(
    ("seen", "ends"), [((2.0, 6.0), (0.0, 6.0)), ((-2.0, 1.0), (-2.0, 4.0)), ((-1.0, 5.0), (-1.0, 5.0))]
)
def test_a_seen_curve_extends_the_known_one_without_a_step(seen, ends):
    new, known = way(*seen, 0.04), way(0.0, 4.0)
    joined, extends = join(new, known, common_places(new, known, AssociationSettings()), MapSettings())
    assert extends
    np.testing.assert_allclose((joined.points[0, 0], joined.points[-1, 0]), ends, atol=1e-6)
    assert (np.diff(joined.points[:, 0]) > 0.0).all()
    assert np.abs(np.diff(joined.points[:, 1])).max() < 0.005


def test_what_noise_adds_to_an_end_is_no_extension():
    new, known = way(2.0, 4.05), way(0.0, 4.0)
    joined, extends = join(new, known, common_places(new, known, AssociationSettings()), MapSettings())
    assert not extends
    assert joined.points[-1, 0] == pytest.approx(4.0)


def test_weights_have_a_limit():
    new, known = way(1.0, 3.0, weight=10.0), way(0.0, 4.0, weight=35.0)
    joined, _ = join(new, known, common_places(new, known, AssociationSettings()), MapSettings(most_weight=40.0))
    assert joined.weights.max() == 40.0
