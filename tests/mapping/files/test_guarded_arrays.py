"""Arrays of numpy are read only where they hold what they claim."""

import io
import zipfile

import numpy as np
import pytest

from lidarium.mapping.files import guarded_arrays
from lidarium.mapping.files.guarded_arrays import GuardedArchive, read_arrays


def npz(**arrays):
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


@pytest.mark.parametrize(
    "values",
    [
        np.arange(12.0).reshape(3, 4),
        np.zeros((0, 3), np.int8),
        np.array("a text"),
        np.asfortranarray(np.eye(3)),
    ],
)
def test_arrays_come_back_alone_and_by_name(tmp_path, values):
    np.save(tmp_path / "a.npy", values)
    np.savez(tmp_path / "b.npz", values=values, other=np.ones(2))
    alone, named = read_arrays(tmp_path / "a.npy", "an array"), read_arrays(tmp_path / "b.npz", "an npz file")
    np.testing.assert_array_equal(alone, values)
    np.testing.assert_array_equal(named["values"], values)
    assert set(named) == {"values", "other"}


def test_objects_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(ValueError, match=r"a\.npy is not an array"):
        read_arrays(tmp_path / "a.npy", "an array")


@pytest.mark.parametrize("kept", [3, 40, -8])
def test_a_file_that_is_cut_off_is_refused_by_name(tmp_path, kept):
    np.save(tmp_path / "a.npy", np.arange(100.0))
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:kept])
    with pytest.raises(ValueError, match=r"a\.npy is not an array"):
        read_arrays(tmp_path / "a.npy", "an array")


def test_members_of_an_archive_have_one_room_together(monkeypatch):
    monkeypatch.setattr(guarded_arrays, "LEAST_ARRAYS", 20_000)
    monkeypatch.setattr(guarded_arrays, "most_unpacked", lambda packed: 0)
    archive = GuardedArchive(npz(a=np.zeros(1500), b=np.zeros(1500)))
    assert archive.array("a").shape == (1500,)
    with pytest.raises(ValueError, match=r"b\.npy has 12,128 bytes when unpacked; there is room for 7,872"):
        archive.array("b.npy")


def test_too_many_members_and_other_ways_to_pack_are_refused():
    many, packed = io.BytesIO(), io.BytesIO()
    with zipfile.ZipFile(many, "w") as archive:
        for k in range(1001):
            archive.writestr(str(k), b"")
    with pytest.raises(ValueError, match="it has 1,001 members; want at most 1,000"):
        GuardedArchive(many.getvalue())
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a", b"abc" * 50)
    with pytest.raises(ValueError, match="a is packed in a way that is not read"):
        GuardedArchive(packed.getvalue()).read("a")
    with pytest.raises(KeyError):
        GuardedArchive(npz(a=np.ones(1))).array("b")
