"""How robots make sparse maps is within bounds."""

import pytest

from lidarium.envs.settings.exploration import SparseMapSettings


@pytest.mark.parametrize(("name", "value"), [("codes", 1), ("cell_m", 0.0), ("least_turn", 7.0), ("most_boxes", 0)])
def test_values_out_of_bounds_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"{name} of the sparse map is {value}"):
        SparseMapSettings(**{name: value})


def test_an_unknown_mode_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="mode of the sparse map is 'thsis'; want one of default, thesis"):
        SparseMapSettings(mode="thsis")
