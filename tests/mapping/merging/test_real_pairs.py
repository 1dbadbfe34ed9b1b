import json
import math
from dataclasses import replace

import numpy as np
import pytest

from lidarium.mapping.files.map_files import read_grey_map, read_ros_map
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.merger import Question, merge_maps
from lidarium.mapping.merging.pair import described, merge_pair
from lidarium.mapping.merging.settings import TOLERANCES, merge_settings


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


def merged_files(first, second, tolerance="normal", is_forced=False):
    """Result of two ROS maps, and how the second lies in the first between their ROS frames."""
    images = [read_ros_map(path) for path in (first, second)]
    settings = replace(merge_settings(), structure="all", confidence=TOLERANCES[tolerance])
    maps = {name: (image.levels, image.resolution) for name, image in zip("ab", images, strict=True)}
    result = merge_maps(maps, settings, Question(is_explained=True, is_forced=is_forced)).pairs["a", "b"]
    assert result.a_from_b is not None
    corners = [Transform(*image.origin) for image in images]
    return result, corners[0] @ result.a_from_b @ corners[1].inverse()


BENT = {
    "near": (Transform(5.127, -9.411, 0.4989), (11.2, 5.8)),
    "far": (Transform(35.733, 14.064, 2.5362), (13.0, 10.4)),
}
"""How the second maps lie in the first, and their middles: to 0.3 m and 2 degrees."""


@pytest.mark.parametrize("name", BENT)
def test_maps_that_are_bent_by_half_a_metre_are_joined(shared_cases, name):
    folder = shared_cases / "bent-pair"
    result, found = merged_files(folder / f"{name}_first.yaml", folder / f"{name}_second.yaml")
    assert result.is_accepted, result.reason
    distance, angle = found.difference(*BENT[name])
    assert distance < 0.3
    assert angle < math.radians(2.0)
    assert result.doubt == ""


def test_force_joins_where_most_speaks_for_it(shared_cases):
    folder = shared_cases / "bent-pair"
    result, found = merged_files(folder / "near_first.yaml", folder / "near_second.yaml", "strict", is_forced=True)
    assert result.reason == "forced against: contradiction: the maps agree only once they are bent"
    distance, angle = found.difference(*BENT["near"])
    assert distance < 0.3
    assert angle < math.radians(2.0)
    assert result.agreement.agreeing_m > 100.0


def test_small_rooms_of_strangers_do_not_bend_until_they_fit(shared_cases):
    folder = shared_cases / "strangers-joined"
    result, _ = merged_files(folder / "false_a.yaml", folder / "false_b.yaml")
    assert not result.is_accepted


@pytest.mark.parametrize("percent", [3, 5, 7])
def test_maps_of_unlike_scale_are_refused_by_it(shared_cases, percent):
    folder = shared_cases / "maps-of-unlike-scale"
    result, _ = merged_files(folder / "first.yaml", folder / f"second_{percent}.yaml")
    assert not result.is_accepted
    assert result.confidence == 0.0
    assert result.reason.startswith("unlike scales: the second map would have to grow about 0.9")
