"""How robots make sparse maps is within bounds."""

import pytest

from lidarium.envs.settings.exploration import SparseMapSettings


@pytest.mark.parametrize(("name", "value"), [("codes", 1), ("cell_m", 0.0), ("least_turn", 7.0), ("most_boxes", 0)])
def test_values_out_of_bounds_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=f"{name} of the sparse map is {value}"):
        SparseMapSettings(**{name: value})
