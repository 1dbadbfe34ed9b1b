"""BenchMARL runs its algorithms on the task of the how-to script."""

import math

import pytest
from trainer_scripts import ROOM, script

pytestmark = pytest.mark.filterwarnings("ignore")  # of TorchRL, about versions of PettingZoo

SHORT = {
    "max_n_iters": 2,
    "on_policy_collected_frames_per_batch": 40,
    "on_policy_n_envs_per_worker": 1,
    "on_policy_n_minibatch_iters": 2,
    "on_policy_minibatch_size": 20,
    "evaluation_episodes": 1,
    "evaluation_interval": 40,
}


@pytest.mark.parametrize("level", ["velocity", "frontier"])
@pytest.mark.parametrize("algorithm", ["IppoConfig", "MappoConfig"])
def test_benchmarl_trains_a_team(algorithm, level, tmp_path):
    module = script("benchmarl_task", "benchmarl", "benchmarl")
    options = {"floor": "scene_room", "threads": 1, "max_cycles": 40, "level": level}
    options |= {"observe": ["velocity", "bumper"]} if level == "velocity" else {}
    chosen = getattr(module, algorithm).get_from_yaml()
    run = module.experiment(options, chosen, config={**SHORT, "save_folder": str(tmp_path)})
    run.run()
    assert run.total_frames == 80
    assert math.isfinite(run.mean_return)


def test_the_horizon_of_the_task_is_that_of_the_environment():
    module = script("benchmarl_task", "benchmarl", "benchmarl")
    task = module.Exploration("EXPLORATION", {**ROOM, "max_cycles": 30})
    assert task.max_steps(None) == 30
    assert task.supports_discrete_actions()
