"""LBG splits codes, and draws nothing."""

import pytest
from scattered_points import room

from lidarium.mapping.sparse.quantisation.splitting import split_codes
from lidarium.mapping.sparse.quantisation.tiles import tiles_of


def test_splitting_is_deterministic_and_doubles():
    tiles = tiles_of(room())
    codes = split_codes(tiles, 64, 7)
    assert codes.shape == (64, 3)
    assert (codes == split_codes(tiles, 64, 7)).all()
    assert len(split_codes(tiles, 1, 7)) == 1
    for count in (0, 3, 48):
        with pytest.raises(ValueError, match="want a power of two"):
            split_codes(tiles, count, 7)
