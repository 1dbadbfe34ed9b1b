import math

import numpy as np
import pytest

from lidarium.benchmarks.studies.merging.bank import bank, drives
from lidarium.benchmarks.studies.merging.bank.bank import (
    BankMap,
    Pair,
    drives_of,
    fill,
    read_maps,
    read_pairs,
    write_pairs,
)
from lidarium.benchmarks.studies.merging.bank.drives import PoseError, _Waves, bank_starts, drive
from lidarium.benchmarks.studies.merging.bank.floors import (
    HALVES,
    BankFloor,
    bank_floors,
    like_rooms,
    without_some_furniture,
)
from lidarium.benchmarks.studies.merging.bank.pairs import Wanted, choose_pairs, overlap_of
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN

SCENE = BankFloor("scene_room", "tuning", "drawn")


def test_the_bank_has_thirty_floors_and_more_and_copies_belong_to_the_half_of_their_originals():
    floors = bank_floors(None)
    originals = {floor.name: floor for floor in floors if not floor.is_copy}
    assert len(originals) >= 30
    assert len({floor.name for floor in floors}) == len(floors)
    assert {floor.half for floor in floors} == set(HALVES)
    for floor in floors:
        assert floor.half == originals[floor.original].half
    assert len(bank_floors(None, every=3)) < len(floors) / 2


def test_like_rooms_are_drawn_by_the_seed_and_their_starts_are_free():
    assert like_rooms(3).sha256 == like_rooms(3).sha256 != like_rooms(4).sha256
    for seed in range(6):
        floor = like_rooms(seed)
        assert len(bank_starts(floor, seed)) == 3
        raster = floor.raster(0.05, 0.3, 0.3)
        for x, y, _ in floor.starts:
            assert raster.solid[int((y - raster.origin[1]) / 0.05), int((x - raster.origin[0]) / 0.05)] == 0


def test_a_copy_lacks_furniture_and_no_walls():
    floor = BankFloor("office-5000", "tuning", "office", 5000).load()
    copy = without_some_furniture(floor, 0)
    assert len(floor.solids) - 3 <= len(copy.solids) < len(floor.solids)
    assert [solid for solid in copy.solids if math.isinf(solid.z_high)] == [
        solid for solid in floor.solids if math.isinf(solid.z_high)
    ]
    with pytest.raises(ValueError, match="no furniture"):
        without_some_furniture(like_rooms(0), 0)


def test_errors_of_poses_are_smooth_and_bounded():
    error = PoseError()
    for seed in range(5):
        waves = _Waves(error, np.random.default_rng(seed))
        track = np.array([waves.at(0.1 * step) for step in range(3000)])
        assert np.hypot(track[:, 0], track[:, 1]).max() <= error.distance_m
        assert np.abs(track[:, 2]).max() <= error.angle
        assert np.abs(np.diff(track[:, :2], axis=0)).max() < 0.002
        assert np.hypot(track[:, 0], track[:, 1]).max() > 0.25 * error.distance_m


def test_drives_keep_growing_maps_that_lie_where_the_truth_says():
    floor = SCENE.load()
    snapshots = drive(floor, bank_starts(floor, 0)[0], 7)
    assert len(snapshots) == 3
    known = [np.count_nonzero(one.levels != UNKNOWN) for one in snapshots]
    assert known == sorted(known)
    raster = floor.raster(0.025, 0.3, 0.3)
    last = snapshots[-1]
    rows, columns = np.nonzero(last.levels == FREE)
    places = last.floor_from_map.apply((np.stack([columns, rows], axis=1) + 0.5) * 0.025)
    cells = np.floor((places - raster.origin) / 0.025).astype(int)
    assert raster.solid[cells[:, 1], cells[:, 0]].mean() < 0.02
    again = drive(floor, bank_starts(floor, 0)[0], 7)
    np.testing.assert_array_equal(last.levels, again[-1].levels)


def test_the_bank_goes_on_where_it_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(bank, "RUNS", 1)
    monkeypatch.setattr(drives, "HORIZON_S", 30.0)
    floors = [SCENE]
    with pytest.raises(FileNotFoundError, match="fill it first"):
        read_maps(tmp_path, floors)
    first = next(iter(fill(tmp_path, floors, 1)))
    assert first[1] is None
    assert len(list(fill(tmp_path, floors, 1))) == len(drives_of(floors)) - 1
    assert list(fill(tmp_path, floors, 1)) == []
    maps = read_maps(tmp_path, floors)
    assert len(maps) == 3 * len(drives_of(floors))
    pairs = list(choose_pairs(maps, wanted=Wanted(plenty=4, little=2)))
    assert {pair.half for pair in pairs} == {"tuning"}
    for pair in pairs:
        assert pair.category in ("positive", "symmetric", "look_alike", "indistinct")
        assert maps[pair.a].start != maps[pair.b].start
        if pair.category == "positive":
            true = maps[pair.a].floor_from_map.inverse() @ maps[pair.b].floor_from_map
            assert pair.a_from_b is not None
            assert pair.a_from_b.difference(true, pair.at)[0] < 1e-9
    write_pairs(tmp_path, pairs)
    assert read_pairs(tmp_path) == pairs
    assert read_pairs(tmp_path / "elsewhere") is None


def test_the_overlap_is_the_share_of_the_smaller_map():
    a, b = np.full((90, 120), UNKNOWN, np.uint8), np.full((60, 60), UNKNOWN, np.uint8)
    a[30:60, 30:90], b[0:30, 0:60] = FREE, OCCUPIED
    half = Transform(60 * 0.025, 30 * 0.025, 0.0)
    maps = [BankMap("", SCENE, 0, 0, levels, Transform()) for levels in (a, b)]
    overlap, at = overlap_of(maps[0], maps[1], half, stride=1)
    assert overlap == pytest.approx(0.5)
    assert at == pytest.approx((15 * 0.025, 15 * 0.025))
    assert overlap_of(maps[0], maps[1], Transform(50.0, 0.0, 0.0))[0] == 0.0


def test_pairs_without_truth_have_no_transform():
    assert Pair("a", "b", "test", "negative").a_from_b is None
