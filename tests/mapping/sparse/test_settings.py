"""Settings of the mapper are checked by name."""

import pytest

from lidarium.mapping.sparse.settings import FloorSettings, MapperSettings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"mode": "printed"}, "mode of the mapper is 'printed'"),
        ({"split": "colour"}, "split of the mapper is 'colour'"),
        ({"voxel_m": -1.0}, "voxel_m of the mapper"),
        ({"seed": 1.5}, "seed of the mapper"),
    ],
)
def test_settings_out_of_bounds_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        MapperSettings(**settings)


def test_up_is_a_direction():
    with pytest.raises(ValueError, match="want a direction"):
        FloorSettings(up_z=0.0)
