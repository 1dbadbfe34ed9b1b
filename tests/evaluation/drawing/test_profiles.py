"""Performance profiles of policies."""

import pytest

from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.drawing.profiles import profiles


@pytest.mark.parametrize("lowest", [0.137, 0.42, 0.9, 0.98])
def test_a_profile_of_coverage_turns_where_episodes_end(row, lowest):
    (group,) = grouped(
        [row(coverage_final=0.99), row(seed=1, coverage_final=0.9903), row(seed=2, coverage_final=lowest)]
    )
    found = profiles(group)["coverage_at_least"]
    share = dict(zip(found["thresholds"], found["share_low_high"]["a"][0], strict=True))
    assert found["thresholds"][0] <= lowest
    assert share[0.99] == pytest.approx(2 / 3)
    assert share[0.995] == 0.0
    assert share[1.0] == 0.0
