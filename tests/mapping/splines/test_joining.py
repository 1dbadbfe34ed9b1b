"""Joint curves of one wall."""

import numpy as np
import pytest

from lidarium.mapping.splines.curves.fitting import fit_bspline
from lidarium.mapping.splines.curves.settings import AssociationSettings, MapSettings
from lidarium.mapping.splines.joining import Way, common_places, join


def along(first, last, y=0.0):
    """A straight curve along x from ``first`` to ``last``."""
    return fit_bspline(np.stack([np.linspace(first, last, 30), np.full(30, y)], axis=1)).spline


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
    joined, _ = join(
        new, known, common_places(new, known, AssociationSettings()), MapSettings(most_weight=40.0)
    )
    assert joined.weights.max() == 40.0
