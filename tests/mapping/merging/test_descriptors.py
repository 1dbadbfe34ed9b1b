import math

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, blank, room

from lidarium.mapping.files.map_files import UNKNOWN
from lidarium.mapping.merging.corners import Corners, CornerSettings, detect_corners
from lidarium.mapping.merging.correspondence import CorrespondenceSettings, _compare_descriptors
from lidarium.mapping.merging.descriptors import VARIANTS, DescriptorSettings, describe_corners


def looking_along(corners, angle):
    """The same corners, all with one angle, so that descriptors are not turned."""
    return Corners(corners.cells, corners.points, np.full(len(corners), angle), corners.neighbours)


@pytest.mark.parametrize("variant", VARIANTS)
def test_a_quarter_turn_of_the_map_shifts_the_columns_by_a_quarter(variant):
    levels = apartment()
    settings = DescriptorSettings(variant=variant)
    corners = detect_corners(levels, RESOLUTION)
    turned_cells = np.stack([levels.shape[0] - 1 - corners.cells[:, 1], corners.cells[:, 0]], axis=1)
    turned = Corners(turned_cells, (turned_cells + 0.5) * RESOLUTION, corners.angles, corners.neighbours)
    # A hair off the lattice, where a sample's cell would be a matter of rounding.
    first = describe_corners(levels, RESOLUTION, looking_along(corners, 1e-4), settings)
    second = describe_corners(
        np.ascontiguousarray(np.rot90(levels, -1)), RESOLUTION, looking_along(turned, 1e-4), settings
    )
    quarter = settings.columns // 4
    np.testing.assert_allclose(np.roll(first.values, quarter, axis=2), second.values, atol=0.03)
    np.testing.assert_allclose(np.roll(first.known, quarter, axis=2), second.known, atol=0.03)


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_angle_of_a_corner_is_column_zero(variant):
    corners = detect_corners(room(blank(80, 90), 10, 20, 50, 50), RESOLUTION)
    values = describe_corners(
        room(blank(80, 90), 10, 20, 50, 50), RESOLUTION, corners, DescriptorSettings(variant=variant)
    ).values
    # All corners of an empty room look alike to one who looks into it.
    similarity = np.corrcoef(values[:, :4].reshape(4, -1))
    assert similarity.min() > 0.8


def test_beyond_the_border_all_is_unknown():
    settings = DescriptorSettings(variant="polar", unknown=0.5, free=0.0)
    corners = Corners(np.array([[0, 0]]), np.array([[0.025, 0.025]]), np.zeros(1), np.array([5]))
    described = describe_corners(np.full((3, 3), 255, np.uint8), RESOLUTION, corners, settings)
    assert described.values[0, -1].tolist() == [0.5] * settings.columns
    assert not described.known[0, -1].any()


def test_two_rings_see_what_one_does_not():
    near, far = DescriptorSettings(variant="polar"), DescriptorSettings()
    levels = apartment()
    changed = levels.copy()
    corners = detect_corners(levels, RESOLUTION, CornerSettings(limit=1))
    column, row = corners.cells[0]
    rows, columns = np.indices(levels.shape)
    changed[np.hypot(rows - row, columns - column) > 0.9 / RESOLUTION] = UNKNOWN
    assert np.array_equal(*(describe_corners(one, RESOLUTION, corners, near).values for one in (levels, changed)))
    assert not np.array_equal(*(describe_corners(one, RESOLUTION, corners, far).values for one in (levels, changed)))


def test_the_number_of_rings_and_columns_follows_the_settings():
    corners = detect_corners(apartment(), RESOLUTION)
    thesis = DescriptorSettings(variant="polar", radius_min=0.05, radius_max=1.25, radius_step=0.05, columns=360)
    assert describe_corners(apartment(), RESOLUTION, corners, thesis).values.shape == (len(corners), 24, 360)


@pytest.mark.parametrize("is_known_only", [True, False])
def test_all_shifts_are_compared_as_a_slow_loop_would(is_known_only):
    levels = apartment()
    corners = detect_corners(levels, RESOLUTION, CornerSettings(limit=6))
    settings = CorrespondenceSettings(is_known_only=is_known_only, shift_window=math.pi, least_known=0.0)
    first = describe_corners(levels, RESOLUTION, corners)
    second = describe_corners(levels, RESOLUTION, looking_along(corners, 0.3))
    similarity, shift = _compare_descriptors(first, second, settings)
    columns = first.values.shape[2]
    for i in range(len(corners)):
        for j in range(len(corners)):
            p, known = first.values[i], first.known[i]
            found = []
            for k in range(-columns // 2 + 1, columns // 2):
                q, other = np.roll(second.values[j], k, axis=1), np.roll(second.known[j], k, axis=1)
                if is_known_only:
                    found.append((p * q).sum() / math.sqrt((p**2 * other).sum() * (q**2 * known).sum()))
                else:
                    found.append(np.corrcoef(p.ravel(), q.ravel())[0, 1])
            assert similarity[i, j] == pytest.approx(max(found), abs=1e-4)
            best = int(np.argmax(found)) - columns // 2 + 1
            assert (
                shift[i, j] == pytest.approx(best * 2.0 * math.pi / columns, abs=1e-5)
                or sorted(found)[-2] > max(found) - 1e-3
            )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "square"}, "variant"),
        ({"radius_min": 0.0}, "radius_min"),
        ({"far_step": 9.0}, "far_min"),
        ({"columns": 4}, "columns"),
        ({"free": math.nan}, "free of descriptors is nan; want a number"),
    ],
)
def test_bad_settings_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        DescriptorSettings(**options)
