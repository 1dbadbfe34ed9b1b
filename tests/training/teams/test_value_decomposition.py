"""Values of a team's choices by TorchRL's mixers."""

import numpy as np
import pytest

import lidarium

torch = pytest.importorskip("torch", reason='PyTorch is not installed: extra "rl"')
pytest.importorskip("torchrl", reason='TorchRL is not installed: extra "torchrl"')

from tensordict import TensorDict  # noqa: E402
from torchrl.objectives import SoftUpdate  # noqa: E402

from lidarium.training.reinforcement.frontier_policy import FrontierRanking  # noqa: E402
from lidarium.training.settings import TeamSettings, ValueSettings  # noqa: E402
from lidarium.training.teams.value_decomposition import _choices, _cut_teams, _loss, _mixer, _teams  # noqa: E402


@pytest.fixture(scope="module")
def team():
    """Two teams of two robots, their first observations, and a network whose corrections are not zero."""
    settings = TeamSettings(algorithm="vdn", value=ValueSettings(decisions=64))
    env = lidarium.vector_env(2, "apartment:7", level="frontier", **settings.options("fast"))
    observations, _ = env.reset(seed=0)
    torch.manual_seed(0)
    network = FrontierRanking(env.single_observation_space)
    torch.nn.init.normal_(network.correction.weight)
    yield settings, env, observations, network
    env.close()


@pytest.mark.parametrize("chance", [0.0, 0.5, 1.0])
def test_choices_are_allowed_ones_whether_drawn_or_not(team, chance):
    _, env, observations, network = team
    seen, generator = _teams(env, observations), np.random.default_rng(0)
    mask = observations["action_mask"].reshape(2, 2, -1) > 0
    for _ in range(50):
        choices = _choices(network, seen, chance, generator)
        assert np.take_along_axis(mask, choices[..., None], axis=2).all()


def test_without_draws_the_choice_is_the_preferred_one(team):
    _, env, observations, network = team
    found = _choices(network, _teams(env, observations), 0.0, np.random.default_rng(0))
    np.testing.assert_array_equal(found.ravel(), network.preferred(observations))


def test_the_loss_of_vdn_is_that_of_the_sum_of_values(team):
    """The reward, and the sum of the best next values discounted, less the sum of the chosen values."""
    settings, env, observations, network = team
    before = _teams(env, observations)
    choices = _choices(network, before, 1.0, np.random.default_rng(1))
    after = _teams(env, env.step(choices.ravel())[0])
    loss = _loss(network, _mixer(settings, env), 0.9)
    SoftUpdate(loss, tau=0.01)
    reward, ended = torch.tensor([[1.0], [2.0]]), torch.tensor([[False], [True]])
    ends = {"reward": reward, "done": ended, "terminated": ended}
    happened = TensorDict(
        {**before, ("agents", "choice"): torch.from_numpy(choices), "next": TensorDict({**after, **ends})}, [2]
    )
    values = [
        network.preferences({name: each.flatten(0, 1) for name, each in seen["agents"].items()}).unflatten(0, (2, 2))
        for seen in (before, after)
    ]
    chosen = values[0].gather(2, torch.from_numpy(choices)[..., None])[..., 0].sum(dim=1)
    best = values[1].masked_fill(~after["agents"]["allowed"], -torch.inf).max(dim=2).values.sum(dim=1)
    wanted = reward[:, 0] + 0.9 * torch.where(ended[:, 0], 0.0, best)
    expected = torch.nn.functional.smooth_l1_loss(chosen, wanted.detach())
    torch.testing.assert_close(loss(happened)["loss"], expected)


def test_robots_that_have_ended_can_only_stay(team):
    _, env, observations, _ = team
    active = np.array([True, False, True, True])
    allowed = _teams(env, observations, active)["agents"]["allowed"].reshape(4, -1).numpy()
    assert not allowed[1, :-1].any()
    assert allowed[1, -1]
    np.testing.assert_array_equal(allowed[active], observations["action_mask"][active] > 0)


@pytest.mark.parametrize(
    ("truncated", "active", "is_cut"),
    [
        ([True, False], [False, True], False),  # the last robot's battery is empty; the other ended before
        ([True, True], [True, True], True),
        ([True, True], [False, True], True),
        ([False, False], [True, True], False),
    ],
)
def test_a_team_is_cut_by_time_only_if_a_robot_that_moved_is(truncated, active, is_cut):
    assert _cut_teams(np.array(truncated), np.array(active), (1, 2)).tolist() == [is_cut]
