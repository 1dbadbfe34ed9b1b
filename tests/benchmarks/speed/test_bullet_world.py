"""The question of PyBullet's world: its lines, each judged."""

import pytest

from lidarium.benchmarks.speed.cases.three_dimensions.bullet_world import measure
from lidarium.benchmarks.speed.harness.timing import Effort

pytest.importorskip("pybullet", reason="the extra bullet is not installed")


def test_all_lines_are_measured():
    lines = measure(Effort(1, 0.01))
    assert len(lines) == 5
    assert all(line.judged is not None and line.to_reach is not None for line in lines)
