"""Depth cameras, with their mounts."""

import math

import pytest

from lidarium.envs.settings.cameras import CAMERAS, DepthCamera


def test_the_rim_of_an_image_is_at_half_the_field_of_view():
    camera = DepthCamera(columns=640, rows=480, field_of_view=math.radians(90.0))
    pinhole = camera.intrinsics
    assert pinhole.fx == pinhole.fy == pytest.approx(320.0)
    left, right = ((column - pinhole.cx) / pinhole.fx for column in (-0.5, 639.5))
    assert (left, right) == pytest.approx((-1.0, 1.0))
    assert pinhole.cy == 239.5
    assert camera.calibration["intrinsics"] == pytest.approx({"fx": 320.0, "fy": 320.0, "cx": 319.5, "cy": 239.5})


def test_a_mount_is_where_and_how_the_camera_looks():
    camera = DepthCamera(forward=0.1, left=-0.2, height=0.6, pitch=0.3, pan=-0.4)
    assert camera.mount.tolist() == [0.1, -0.2, 0.6, 0.3, -0.4]


def test_images_are_at_most_one_a_step():
    camera = DepthCamera(rate_hz=5.0)
    assert [camera.period_steps(step) for step in (0.02, 0.1, 0.3)] == [10, 2, 1]


def test_any_noise_makes_a_camera_noisy():
    assert [name for name, camera in CAMERAS.items() if camera.is_noisy] == ["xtion_noisy"]
    assert DepthCamera(disparity_step=0.01).is_noisy


def test_depths_are_precise_up_to_where_noise_and_rounding_deviate_by_a_centimetre():
    noisy = CAMERAS["xtion_noisy"]
    depth = noisy.precise_m
    noise, rounding = 0.0012 + 0.0019 * (depth - 0.4) ** 2, depth**2 / 345.0 / math.sqrt(12.0)
    assert math.hypot(noise, rounding) == pytest.approx(0.01, abs=1e-4)
    assert CAMERAS["xtion"].precise_m == 4.0
    assert DepthCamera(noise_floor=0.0099).precise_m == 4.0


def test_a_camera_without_precise_depths_is_used_as_it_is():
    assert DepthCamera(noise_floor=0.02).precise_m == 4.0


def test_a_camera_that_measures_nothing_is_refused():
    with pytest.raises(ValueError, match=r"depth_min of the camera is 4\.0 m; want less than depth_max, 4\.0 m"):
        DepthCamera(depth_min=4.0)
