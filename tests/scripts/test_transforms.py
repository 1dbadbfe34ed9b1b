"""How maps lie to each other, as transforms.json has it."""

import math

import pytest

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.pair import PairResult
from lidarium.scripts.transforms import CONTRADICTS, WAITS, PlacedMaps, transforms

FOUND = Transform(1.0, 2.0, math.pi / 2)
CORNERS = {"a": Transform(-1.0, 0.0, 0.0), "b": Transform(0.0, -3.0, 0.0)}


def placed(is_accepted=True, **given):
    result = PairResult(is_accepted, "accepted" if is_accepted else "too few corners", FOUND, matches=7, inliers=5)
    groups = [{"a": Transform(), "b": FOUND}, {"c": Transform()}]
    return transforms(PlacedMaps(groups, {("a", "b"): result}, CORNERS, **given))


def test_a_map_that_is_alone_lies_nowhere():
    found = placed(used=[("a", "b")])
    assert found["world"] == "a"
    assert found["maps"]["a"] == {"x": 0.0, "y": 0.0, "theta": 0.0, "group": 0}
    assert found["maps"]["b"] == {"x": 1.0, "y": 2.0, "theta": round(math.pi / 2, 8), "group": 0}
    assert found["maps"]["c"] is None


def test_a_pair_is_between_frames_and_not_between_corners():
    (pair,) = placed(used=[("a", "b")])["pairs"]
    wanted = CORNERS["a"] @ FOUND @ CORNERS["b"].inverse()
    assert (pair["x"], pair["y"], pair["theta"]) == pytest.approx((wanted.x, wanted.y, wanted.theta), abs=1e-6)
    assert (pair["matches"], pair["inliers"], pair["alternatives"], pair["bend_m"]) == (7, 5, [], None)


def test_a_pair_that_is_not_used_says_why():
    reasons = [
        (pair["accepted"], pair["reason"])
        for given in (
            {"used": [("a", "b")]},
            {"dropped": [("a", "b")]},
            {},
            {"is_accepted": False},
        )
        for pair in placed(**given)["pairs"]
    ]
    assert reasons == [(True, "accepted"), (False, CONTRADICTS), (False, WAITS), (False, "too few corners")]


def test_where_nothing_was_found_there_are_no_numbers():
    nothing = PlacedMaps([{"a": Transform()}], {("a", "b"): PairResult(False, "no walls")}, CORNERS)
    (pair,) = transforms(nothing)["pairs"]
    assert (pair["x"], pair["y"], pair["theta"]) == (None, None, None)
