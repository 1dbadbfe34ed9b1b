"""What is observed beside what kernels write needs its sensors."""

from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.observables import SENSED, check_sensed


def test_depth_needs_a_camera_and_has_its_size():
    with pytest.raises(ValueError, match="observe has 'depth', which needs a camera: set camera"):
        make_settings(observe=("scan", "depth"))
    settings = make_settings(observe=("scan", "depth"), camera="depth_64x48")
    check_sensed(settings)
    box = SENSED["depth"].box(settings)
    assert box.shape == (1, 48, 64)
    assert box.high.max() == np.float32(settings.camera.depth_max)
    assert box.dtype == np.float32


def test_names_that_no_sensor_has_need_nothing():
    check_sensed(SimpleNamespace(observe=("scan", "map"), camera=None))


@pytest.mark.parametrize("name", list(SENSED))
def test_all_spaces_are_bounded(name):
    settings = make_settings(robots=3, camera="xtion", observe=("scan",), horizon_s=60.0)
    box = SENSED[name].box(settings)
    assert np.isfinite(box.low).all()
    assert np.isfinite(box.high).all()
