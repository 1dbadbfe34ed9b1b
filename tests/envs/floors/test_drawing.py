import numpy as np
import pytest

from lidarium.envs.floors.drawing import fill_shapes, ring_edges, strip, strip_edges


def test_rectangles_around_many_segments_are_those_around_each():
    segments = np.random.default_rng(0).uniform(-5.0, 5.0, (50, 4))
    segments[7, 2:] = segments[7, :2]  # a point
    widths = np.random.default_rng(1).uniform(0.1, 1.0, 50)
    wanted = [ring_edges(strip(each, width, width / 2.0)) for each, width in zip(segments, widths, strict=True)]
    np.testing.assert_allclose(strip_edges(segments, widths, 0.5), wanted, atol=1e-12)
    np.testing.assert_allclose(strip_edges(segments, 0.3)[3], ring_edges(strip(segments[3], 0.3)), atol=1e-12)
    assert strip_edges(np.zeros((0, 4)), 0.1).shape == (0, 4, 4)


def inside(ring, points):
    """Even-odd rule by counting crossings to the left, point by point."""
    x, y, x_end, y_end = ring_edges(ring).T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x + (points[:, 1:] - y) * (x_end - x) / (y_end - y)
    is_met = (np.minimum(y, y_end) <= points[:, 1:] - 1e-12) & (points[:, 1:] - 1e-12 < np.maximum(y, y_end))
    return (is_met & (crossing <= points[:, :1])).sum(axis=1) % 2 == 1


@pytest.mark.parametrize("corners", [3, 8, 60])  # few and many crossings of a row
def test_shapes_fill_the_cells_whose_centres_are_inside(corners):
    ring = np.random.default_rng(corners).uniform(0.3, 9.7, (corners, 2))
    cells = np.zeros((100, 100), np.uint8)
    fill_shapes(cells, (0.0, 0.0), 0.1, [ring_edges(ring)], 3)
    rows, columns = np.mgrid[:100, :100]
    centres = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1) * 0.1
    assert np.array_equal(cells.ravel() == 3, inside(ring, centres))
    assert set(np.unique(cells)) == {0, 3}
