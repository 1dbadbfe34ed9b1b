"""The scripts that train several seeds, compare them on unseen floors, and draw rewards."""

import json

import numpy as np
import pytest
from trainer_scripts import script


def test_a_learning_run_compares_networks_and_policies_on_unseen_floors(tmp_path):
    module = script("learning_run", "torch", "rl")
    plan = module.Plan(
        seeds=2,
        updates=1,
        train_floors="set:train:2",
        floors="set:validation:2",
        horizon_s=4.0,
        workers=2,
        out=tmp_path,
    )
    module.main(plan)
    numbers = json.loads((tmp_path / "training.json").read_text())
    assert set(numbers["coverage"]) == {"random_walk", "nearest_frontier", "learned", "untrained network"}
    assert all(len(reached) == 2 for reached in numbers["coverage"].values())
    assert all(0.0 < each <= 1.0 for reached in numbers["coverage"].values() for each in reached)
    page = (tmp_path / "training.md").read_text()
    assert page.count("\n| `") == 4
    assert (tmp_path / "training.png").stat().st_size > 1000


def test_networks_that_attend_are_compared_with_what_they_were(tmp_path):
    module = script("attention", "sb3_contrib", "rl")
    plan = module.Attention(
        seeds=1,
        updates=1,
        train_floors="set:train:2",
        floors="set:validation:2",
        horizon_s=4.0,
        workers=1,
        out=tmp_path,
    )
    module.main(plan)
    numbers = json.loads((tmp_path / "attention.json").read_text())
    assert set(numbers["coverage"]) == {"random_walk", "nearest_frontier", "learned", "untrained network"}
    assert all(0.0 < each <= 1.0 for reached in numbers["coverage"].values() for each in reached)
    page = (tmp_path / "attention.md").read_text()
    assert page.count("\n| `") == 4
    assert "2,048 decisions" in page


def test_curves_are_means_of_the_last_updates_that_had_an_end():
    module = script("learning_run", "torch", "rl")
    found = module.smoothed([np.nan, 1.0, 3.0, np.nan, 5.0, 7.0])
    assert np.isnan(found[0])
    assert found[1:].tolist() == [1.0, 2.0, 2.0, 3.0, 5.0]


def test_the_table_of_rewards_says_what_each_gained():
    module = script("shaping", "torch", "rl")
    curve = [0.2] * 2 + [0.3] * 6 + [0.4] * 2
    line = module.table({"area": [curve, curve]}).splitlines()[0]
    assert line == "| area | `default` | 20.0 ± 0.0 % | 40.0 ± 0.0 % | 20.0 ± 0.0 % |"


@pytest.mark.parametrize("reward", ["area", "completion alone"])
def test_a_reward_is_learned_by(reward):
    module = script("shaping", "torch", "rl")
    plan = module.Plan(updates=1, train_floors="set:train:2", horizon_s=4.0)
    (coverage,) = module.learn(plan, (reward, 0))
    assert np.isnan(coverage) or 0.0 < coverage <= 1.0
