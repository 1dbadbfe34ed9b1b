"""What vectors write agrees with what maps hold."""

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.vectors import LEVELS


def test_the_levels_are_those_of_maps():
    assert LEVELS == (OCCUPIED, UNKNOWN, FREE)
