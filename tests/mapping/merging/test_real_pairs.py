import json
import math

import numpy as np
import pytest

from lidarium.mapping.files.map_files import read_grey_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import merge_settings


def real_truth(pixel, resolution, rows_a, rows_b):
    """Transform of a pair whose truth is q_a = R q_b + t in pixels, y down."""
    theta = math.radians(pixel["theta_deg"])
    corner = Transform(pixel["tx"], pixel["ty"], theta).apply((0.0, rows_b))
    return Transform(float(corner[0]) * resolution, (rows_a - float(corner[1])) * resolution, -theta)


def test_a_transform_of_pixels_that_run_down_is_turned_round():
    truth = real_truth({"theta_deg": 30.0, "tx": 1.0, "ty": -2.0}, 0.1, 40, 50)
    pixel_b = np.array([7.0, 11.0])
    pixel_a = Transform(1.0, -2.0, math.radians(30.0)).apply(pixel_b)
    place_b = np.array([pixel_b[0], 50.0 - pixel_b[1]]) * 0.1
    place_a = np.array([pixel_a[0], 40.0 - pixel_a[1]]) * 0.1
    np.testing.assert_allclose(truth.apply(place_b), place_a)


@pytest.mark.parametrize(
    "name", ["intel_hard", "freiburg-079_easy", "freiburg-079_hard", "csail_hard", "belgioioso_hard"]
)
def test_real_maps_are_joined_right_or_refused(shared_data, name):
    folder = shared_data / "map_pairs" / "log_split"
    if not folder.is_dir():
        pytest.skip(f"no pairs of maps at {folder}")
    truth = json.loads((folder / "ground_truth.json").read_text())[name]
    resolution = truth["resolution"]
    a, b = (read_grey_map(folder / truth[key], resolution).levels for key in "AB")
    chosen = merge_settings()
    result = merge_pair(described(a, resolution, chosen), described(b, resolution, chosen), chosen)
    if name in ("intel_hard", "freiburg-079_easy", "csail_hard"):
        assert result.is_accepted, result.reason
    if result.is_accepted:
        assert result.a_from_b is not None
        wanted = real_truth(truth["pixel"], resolution, a.shape[0], b.shape[0])
        distance, angle = result.a_from_b.difference(wanted, result.agreement.centre)
        assert distance < 0.1
        assert angle < math.radians(1.0)
