"""The study of parity: a drive in both worlds, and the page."""

import json

import pytest
from published_pages import assert_published

from lidarium.benchmarks.studies import parity

pytest.importorskip("pybullet", reason="the extra bullet is not installed")


def test_a_drive_compares_both_worlds_and_the_page_has_a_line_for_each_robot(tmp_path, monkeypatch):
    monkeypatch.setattr(parity, "DRIVE_S", 2.0)
    monkeypatch.setattr(parity, "FLOORS", ("scene_room",))
    monkeypatch.setattr(parity, "SEEDS", range(1))
    assert [count for _, count, _ in parity.work(tmp_path, None, 1, 1)][-1] == 3
    lines = [json.loads(line) for line in (tmp_path / parity.DRIVES_FILE).read_text().splitlines()]
    for line in lines:
        assert line["same"] == line["scans"] > 0
        if not any(line["touches"][:2]):
            assert line["apart"][0] < parity.DISTANCE_M
    page = parity.page(tmp_path)
    assert_published("parity", page, tmp_path)
    assert all(f"| {robot} |" in page for robot in parity.ROBOTS)
