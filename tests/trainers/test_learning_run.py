"""The scripts that train several seeds, compare them on unseen floors, and draw rewards."""

import json
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from trainer_scripts import script

import lidarium


class Here(ThreadPoolExecutor):
    """A pool without processes, which starts at once; what it is given can be sent to a process."""

    def __init__(self, workers, context):
        super().__init__(1)

    def map(self, do, tasks):
        return super().map(pickle.loads(pickle.dumps(do)), tasks)


def test_a_learning_run_compares_networks_and_policies_on_unseen_floors(tmp_path, monkeypatch):
    module = script("learning_run", "torch", "rl")
    monkeypatch.setattr(module, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(module.torch, "set_num_threads", lambda threads: None)  # it would hold for all tests
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
    assert set(numbers["coverage"]) == {*module.CLASSIC, "trained networks", "untrained networks"}
    assert all(len(reached) == 2 for reached in numbers["coverage"].values())
    assert all(0.0 < each <= 1.0 for reached in numbers["coverage"].values() for each in reached)
    page = tmp_path / "training.md"
    assert page.read_text().count("\n| `") == len(module.CLASSIC)
    assert (tmp_path / "training.png").stat().st_size > 1000
    page.write_text(page.read_text() + "\n## Notes\n\nBeside other work.\n")
    module.main(module.Plan(seeds=0, floors="set:validation:2", horizon_s=4.0, workers=1, out=tmp_path))
    assert json.loads((tmp_path / "training.json").read_text()) == numbers
    assert page.read_text().endswith("\n## Notes\n\nBeside other work.\n")


def test_all_that_are_compared_begin_at_the_same_starts(monkeypatch):
    module = script("learning_run", "torch", "rl")
    begun, make, run = [], lidarium.vector_env, lidarium.run_episode

    def batch(*args, **options):
        env = make(*args, **options)
        begun.append(env)
        return env

    def noted(policy, env, **options):
        begun.append(env)
        return run(policy, env, **options)

    monkeypatch.setattr(lidarium, "vector_env", batch)
    monkeypatch.setattr(lidarium, "run_episode", noted)
    floors, options = lidarium.floor_set("set:validation:3"), {"robots": 1, "horizon_s": 1.0}
    for starts in ({}, {"starts": "drawn"}):
        begun.clear()
        module.final_coverage(module.drawn_by(module.Scorer()), floors, {**module.ROBOT, **options, **starts})
        module.classic_coverage("random_walk", floors, {**options, **starts})
        networks, *classic = begun
        poses = [np.array(start.starts) for start in networks.engine.starts]
        for pose, env in zip(poses, classic, strict=True):
            np.testing.assert_array_equal(pose, np.array(env.engine.starts[0].starts))
        if not starts:
            own = poses
    assert not any(np.allclose(fixed, drawn) for fixed, drawn in zip(own, poses, strict=True))


def test_the_conclusion_is_made_of_the_figures():
    module = script("learning_run", "torch", "rl")
    coverage = {name: [0.2 + 0.1 * k, 0.4 + 0.1 * k] for k, name in enumerate(module.CLASSIC)}
    coverage |= {module.LEARNED: [0.8, 0.9], module.UNTRAINED: [0.1, 0.2]}
    words = module.conclusion(60.0, coverage)
    assert "Trained networks see 85.0 % of an unseen floor in 60 s" in words
    assert "`learned`, the best classic policy, 80.0 %" in words
    assert words.count("\n") < 5


def test_networks_that_attend_are_compared_with_what_they_were(tmp_path, monkeypatch):
    module = script("attention", "sb3_contrib", "rl")
    make, worlds = module.lidarium.sb3_vec_env, []

    def noted(*arguments, **options):
        worlds.append(options["realism"])
        return make(*arguments, **options)

    monkeypatch.setattr(module.lidarium, "sb3_vec_env", noted)
    monkeypatch.setattr(module, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(module, "ROLLOUT", 8)
    monkeypatch.setattr(module.torch, "set_num_threads", lambda threads: None)  # it would hold for all tests
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
    assert set(numbers["coverage"]) == {*numbers["drawn"], module.UNTRAINED, *module.WORLDS}
    assert all(0.0 < each <= 1.0 for reached in numbers["coverage"].values() for each in reached)
    assert worlds == ["ideal", "fast"]
    page = (tmp_path / "attention.md").read_text()
    assert page.count("\n| `") == len(numbers["drawn"])
    assert "256 decisions" in page


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
