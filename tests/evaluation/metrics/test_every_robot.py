"""Figures of right maps are good for every robot of the catalogue, whatever its radius in cells is."""

import numpy as np
import pytest
from scipy import ndimage

import lidarium
from lidarium.evaluation.episodes.result import EpisodeData, figures_of
from lidarium.registry import registry

NEAR = np.ones((3, 3), bool)


@pytest.mark.parametrize("name", sorted(registry("robot")))
def test_figures_of_a_right_map_are_good_and_those_of_their_definitions(name):
    env = lidarium.parallel_env(
        "srt_l_room", robots=1, robot=name, lidar="lidar_360_20m", resolution=0.05, starts="fixed"
    )
    env.reset(seed=0)
    for _ in range(3):
        env.step({"robot_0": np.zeros(2, np.float32)})
    data = EpisodeData(env)
    figures = figures_of(data, ["iou_occupied", "f1_occupied", "coverage_final", "free_error_rate"])
    assert figures["iou_occupied"] > 0.8
    assert figures["f1_occupied"] > 0.9
    truth, believed = data.truth.occupied, data.team_map > 0
    wall = truth & ndimage.binary_dilation(data.sensed & data.truth.counted, NEAR)
    hits = (believed & ndimage.binary_dilation(wall, NEAR)).sum() + (
        wall & ndimage.binary_dilation(believed, NEAR)
    ).sum()
    assert figures["iou_occupied"] == pytest.approx(hits / (believed.sum() + wall.sum()), abs=1e-9)
    counted = data.truth.counted
    assert figures["coverage_final"] == pytest.approx((data.sensed & counted).sum() / counted.sum(), abs=1e-9)
    free = data.team_map < 0
    assert figures["free_error_rate"] == pytest.approx((free & truth).sum() / free.sum(), abs=1e-9)
