"""Numpy arrays as floors."""

import numpy as np
import pytest
from imported_floors import free_of, room

from lidarium.envs.floors.importers import load_file


def test_arrays_are_read_with_their_rows_from_the_top_or_with_their_own_frame(tmp_path):
    np.save(tmp_path / "grid.npy", room())
    with pytest.raises(ValueError, match="--resolution"):
        load_file(tmp_path / "grid.npy")
    assert free_of(load_file(tmp_path / "grid.npy", 0.1), 0.1).any()
    np.savez(tmp_path / "grid.npz", solid=(room()[::-1] != 254), origin=(5.0, 6.0), resolution=0.1)
    floor = load_file(tmp_path / "grid.npz")
    assert free_of(floor, 0.1).sum() == 18 * 28 - 25 - 4
    assert floor.bounds == pytest.approx((5.1, 6.1, 7.9, 7.9))
    np.savez(tmp_path / "half.npz", solid=np.zeros((3, 3)))
    with pytest.raises(ValueError, match="no array origin, resolution"):
        load_file(tmp_path / "half.npz")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resolution": 0.0}, "resolution"),
        ({"origin": (0.0, np.nan)}, r"want \(x, y\) in metres"),
        ({"solid": np.zeros(4)}, r"shape \(4,\)"),
        ({"solid": np.zeros((2, 2), "U1")}, "want rows and columns of numbers"),
    ],
)
def test_an_archive_that_is_no_floor_is_refused(tmp_path, changes, message):
    content = {"solid": room() != 254, "origin": (0.0, 0.0), "resolution": 0.1}
    np.savez(tmp_path / "a.npz", **{**content, **changes})
    with pytest.raises(ValueError, match=message):
        load_file(tmp_path / "a.npz")


def test_true_is_solid_in_an_array_of_booleans(tmp_path):
    np.save(tmp_path / "a.npy", room() != 254)
    np.save(tmp_path / "b.npy", room())
    solid, grey = (free_of(load_file(tmp_path / f"{name}.npy", 0.1), 0.1) for name in "ab")
    assert solid.sum() == 18 * 28 - 25 - 4
    assert grey.sum() == 18 * 28 - 25
