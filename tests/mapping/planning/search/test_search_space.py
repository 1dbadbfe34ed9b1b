"""What a search found, readable until the next one."""

import numpy as np
import pytest
from searched_beliefs import made, open_start, random_belief

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Until, search


def test_searches_do_not_see_what_earlier_searches_left():
    belief = random_belief(3, shape=(60, 70))
    footprint = Footprint(0.03, 0.1)
    space, field = made(belief)
    start, other = open_start(belief, footprint, 1), open_start(belief, footprint, 2)
    first = search(space, belief, field, start, footprint).costs()
    old = search(space, belief, field, other, footprint, until=Until(maximum_cost=0.3))
    assert old.costs()[np.isfinite(old.costs())].max() <= 0.3
    np.testing.assert_array_equal(search(space, belief, field, start, footprint).costs(), first)
    with pytest.raises(ValueError, match="another search"):
        old.cost(start)


def test_the_reached_cells_are_those_with_finite_costs():
    belief = random_belief(5, shape=(60, 70))
    footprint = Footprint(0.05, 0.1)
    space, field = made(belief)
    found = search(space, belief, field, open_start(belief, footprint, 1), footprint)
    mask = np.zeros(belief.shape, bool)
    mask[tuple(found.reached().T)] = True
    np.testing.assert_array_equal(mask, np.isfinite(found.costs()))
