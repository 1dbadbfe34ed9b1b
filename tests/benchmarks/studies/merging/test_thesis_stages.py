"""Stages of the thesis's rules: on maps without noise corners repeat and maps join, on ragged ones not."""

import math

import pytest
from drawn_maps import about_middle, apartment, moved, noisy

from lidarium.benchmarks.studies.merging.bank.bank import BankMap, Pair
from lidarium.benchmarks.studies.merging.bank.floors import BankFloor
from lidarium.benchmarks.studies.merging.thesis import (
    stages_text,
    thesis_stages,
    twelve_pairs,
    twelve_text,
)
from lidarium.mapping.geometry.rigid import Transform

FLOOR = BankFloor("apartment-1", "test", "apartment", 1)


def bank(is_ragged):
    """Three starts, two maps each, all of the whole apartment: each start has a quarter turn of its own."""
    maps = {}
    for start in range(3):
        turn = about_middle(0.5 * math.pi * start, apartment())
        # Drawn in cells of 5 cm, read as cells of 2.5 cm: half as large.
        placed = Transform(0.5 * turn.x, 0.5 * turn.y, turn.theta).inverse()
        for stage in (0, 2):
            levels = moved(apartment(), turn)
            key = f"apartment-1_{start}_0_{stage}"
            ragged = noisy(levels, 10 * start + stage) if is_ragged else levels
            maps[key] = BankMap(key, FLOOR, start, stage, ragged, placed)
    a, b = maps["apartment-1_0_0_2"], maps["apartment-1_1_0_2"]
    true = a.floor_from_map.inverse() @ b.floor_from_map
    return maps, [Pair(a.key, b.key, "test", "positive", 1.0, (true.x, true.y, true.theta), (4.0, 4.0))]


def test_without_noise_corners_repeat_and_the_discs_agree():
    maps, pairs = bank(is_ragged=False)
    (row,) = thesis_stages(maps, pairs)
    assert row["repeated"] > 0.8
    assert row["right"] >= 3
    assert row["discs_at_truth"] > 0.9
    rough_maps, rough_pairs = bank(is_ragged=True)
    (rough,) = thesis_stages(rough_maps, rough_pairs)
    assert rough["repeated"] < row["repeated"]
    assert rough["discs_at_truth"] < row["discs_at_truth"]
    assert "right matches" in stages_text([row, rough])


def test_twelve_pairs_of_three_starts_have_the_errors_that_the_thesis_lacks():
    maps, _ = bank(is_ragged=False)
    rows = twelve_pairs(maps)
    assert len(rows) == 12
    assert [row["pair"] for row in rows[:4]] == ["A1-B1", "A1-B2", "A1-C1", "A1-C2"]
    assert all(row["overlap"] == pytest.approx(1.0, abs=0.05) for row in rows)
    joined = [row for row in rows if row["is_accepted"]]
    assert joined
    assert all(row["error_m"] < 0.5 for row in joined)
    assert twelve_text(rows).count("\n") == 13


def test_a_bank_without_positives_says_so():
    assert "no positives" in stages_text(thesis_stages({}, []))
    assert twelve_pairs({}) == []
