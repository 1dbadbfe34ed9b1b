"""RLlib's new API stack trains teams as it is."""

import math

import pytest
from trainer_scripts import ROOM, script

pytestmark = pytest.mark.filterwarnings("ignore")  # of Ray, about itself


@pytest.fixture(scope="module")
def rllib():
    module = script("with_rllib", "ray", "rllib")
    module.ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield module
    module.ray.shutdown()


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"stop_on_contact": True},
        {"stop_on_contact": True, "ended_agents": "zeros"},
        {"level": "frontier"},
    ],
    ids=str,
)
def test_ppo_of_rllib_trains_a_team(rllib, more):
    first, last = rllib.train({**ROOM, **more}, iterations=2, steps=160)
    for report in (first, last):
        losses = report["learners"]["shared"]
        assert math.isfinite(losses["total_loss"])
        assert losses["diff_num_grad_updates_vs_sampler_policy"] >= 0
    assert last["env_runners"]["num_env_steps_sampled_lifetime"] >= 320
    assert last["env_runners"]["num_episodes_lifetime"] >= 1


def test_processes_of_ray_make_environments_of_their_own(rllib):
    (report,) = rllib.train(ROOM, iterations=1, steps=160, runners=1)
    assert report["env_runners"]["num_env_steps_sampled_lifetime"] >= 160
