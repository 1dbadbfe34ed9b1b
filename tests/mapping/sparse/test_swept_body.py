"""A body is swept along a segment without meeting a box, or it is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.swept_body import (
    SweptBody,
    are_free,
    cylinder_holds,
    index_boxes,
    squared_gap,
)

COORDINATE = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))


def sampled_gap(a, b, box):
    """Distance between a segment and a rectangle, by many points of the segment."""
    points = a + np.linspace(0.0, 1.0, 4001)[:, None] * (b - a)
    beyond = np.maximum(np.maximum(box[:2] - points, points - box[3:5]), 0.0)
    return np.hypot(*beyond.T).min()


@given(*[COORDINATE] * 6, st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_the_gap_of_a_segment_is_that_of_its_nearest_point(x1, y1, x2, y2, low_x, low_y, width, depth):
    box = np.array([low_x, low_y, 0.0, low_x + width, low_y + depth, 1.0])
    gap = np.sqrt(squared_gap(x1, y1, x2, y2, box))
    assert gap == pytest.approx(sampled_gap(np.array([x1, y1]), np.array([x2, y2]), box), abs=2e-3)


def free_by_all(boxes, a, b, body):
    """Whether a body can be driven, by all boxes."""
    low, high = min(a[2], b[2]) + body.clearance, max(a[2], b[2]) + body.height
    return not any(
        box[2] < high and box[5] > low and squared_gap(a[0], a[1], b[0], b[1], box) < body.radius**2
        for box in boxes.reshape(-1, 6)
    )


@pytest.mark.parametrize("cell", [0.1, 0.25, 2.0])
def test_the_index_leaves_out_no_box(cell):
    generator = np.random.default_rng(0)
    low = generator.uniform(-4.0, 4.0, (80, 3)) * (1.0, 1.0, 0.3) + (0.0, 0.0, 0.8)
    boxes = np.stack([low, low + generator.uniform(0.0, 1.0, (80, 3))], axis=1)
    body = SweptBody(radius=0.25, height=1.0)
    starts, ends = (generator.uniform(-6.0, 6.0, (400, 3)) * (1.0, 1.0, 0.05) for _ in range(2))
    ends[:50] = starts[:50]  # bodies that stand
    ends[50:80, 0] = starts[50:80, 0]  # straight along an axis
    found = are_free(index_boxes(boxes, cell), starts, ends, body.numbers)
    expected = [free_by_all(boxes, a, b, body) for a, b in zip(starts, ends, strict=True)]
    assert found.tolist() == expected
    assert 0.1 < found.mean() < 0.9


def test_a_table_top_is_in_the_way_of_a_tall_body_only():
    top = np.array([[[1.0, -0.5, 0.7], [2.0, 0.5, 0.75]]])
    a, b = np.array([[0.0, 0.0, 0.0]]), np.array([[3.0, 0.0, 0.0]])
    for height, expected in ((1.2, False), (0.7, True), (0.6, True)):
        body = SweptBody(radius=0.3, height=height)
        assert are_free(index_boxes(top), a, b, body.numbers)[0] == expected


def test_nothing_is_in_the_way_where_nothing_stands():
    body = SweptBody()
    assert are_free(index_boxes(np.zeros((0, 2, 3))), np.zeros((1, 3)), np.ones((1, 3)), body.numbers)[0]


def test_a_cylinder_holds_what_lies_between_its_caps_and_within_its_radius():
    generator = np.random.default_rng(1)
    points = generator.uniform(-2.0, 2.0, (10_000, 3))
    for _ in range(5):
        a, b = generator.uniform(-1.5, 1.5, (2, 3))
        axis = (b - a) / np.linalg.norm(b - a)
        along = (points - a) @ axis
        beside = np.linalg.norm(points - a - along[:, None] * axis, axis=1)
        expected = (along >= 0.0) & (along <= np.linalg.norm(b - a)) & (beside <= 0.4)
        held = cylinder_holds(a, b, points, 0.4)
        assert (held == expected).all()
        # What the thesis prints has its signs reversed: it holds what lies before the first cap.
        assert not held[along < 0.0].any()
        assert not held[along > np.linalg.norm(b - a)].any()
        assert not held[beside > 0.4].any()


def test_a_cylinder_without_an_axis_is_a_ball():
    points = np.array([[0.0, 0.0, 0.3], [0.3, 0.3, 0.0], [0.0, 0.0, 0.31]])
    assert cylinder_holds(np.zeros(3), np.zeros(3), points, 0.3).tolist() == [True, False, False]


@pytest.mark.parametrize("values", [{"radius": 0.0}, {"height": np.nan}, {"clearance": 2.0}, {"height": 0.03}])
def test_bodies_that_cannot_be_are_refused(values):
    with pytest.raises(ValueError, match="body"):
        SweptBody(**values)
