"""AgileRL trains a team as it is."""

import math

import pytest
from trainer_scripts import ROOM, script

pytestmark = pytest.mark.filterwarnings("ignore")  # of AgileRL's own dependencies


@pytest.mark.parametrize("more", [{}, {"stop_on_contact": True}], ids=str)
def test_ippo_of_agilerl_trains_a_team(more):
    module = script("with_agilerl", "agilerl", "agilerl")
    scores = module.train({**ROOM, **more}, steps=128, rollout=64, copies=1)
    assert scores
    assert all(math.isfinite(score) for score in scores)
