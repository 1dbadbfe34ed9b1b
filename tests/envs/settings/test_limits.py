"""What can be observed, and how much a step may do."""

import numpy as np
import pytest

from lidarium.envs.settings.limits import (
    PRODUCTS,
    check_level,
    check_workload,
    egocentric_scales_of,
    observed_names,
)
from lidarium.envs.settings.making import make_settings


def test_names_are_put_into_the_order_of_observations():
    assert observed_names(["action_mask", "coverage", "pose", "scan"]) == (
        "scan",
        "pose",
        "coverage",
        "action_mask",
    )


@pytest.mark.parametrize("names", [("frontiers",), ("scan", "frontier_gains")])
def test_what_is_there_with_frontiers_only_needs_their_level(names):
    check_level(names, "frontier")
    with pytest.raises(ValueError, match=f"observe has '{names[-1]}', which needs level='frontier'"):
        check_level(names, "waypoint")


def test_scales_are_whole_numbers_also_of_numpy():
    assert egocentric_scales_of(np.array([1, 4])) == (1, 4)
    with pytest.raises(ValueError, match="has 17 scales; want at most 16"):
        egocentric_scales_of([1] * 17)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (
            {"lidar": {"range_max": 200.0}, "resolution": 0.01, "raster_resolution": 0.01},
            "the path that a scan covers",
        ),
        ({"robots": 64, "lidar": {"beams": 4097}}, "the number of beams of the team"),
        ({"robots": 64, "map_cells": 4096}, "the size of what is observed"),
        ({"decision_period_s": 1e5, "time_step": 0.001}, "the number of steps of a decision"),
    ],
)
def test_a_step_that_takes_too_much_is_named_with_the_cure(options, what):
    cures = {product.what.partition(",")[0]: product.cure for product in PRODUCTS}
    cure = next(cure for product, cure in cures.items() if product.startswith(what))
    with pytest.raises(ValueError, match=what) as refused:
        make_settings(**options)
    assert cure in str(refused.value)


def test_usual_settings_are_far_from_all_limits():
    settings = make_settings(robots=16)
    check_workload(settings)
    assert max(product.of(settings) / product.most for product in PRODUCTS) < 0.1
