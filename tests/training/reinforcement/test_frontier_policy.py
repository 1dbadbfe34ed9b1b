"""Attention to the frontiers on offer, as a policy of MaskablePPO."""

import numpy as np
import pytest

import lidarium

torch = pytest.importorskip("torch", reason='PyTorch is not installed: extra "rl"')
sb3_contrib = pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')

from lidarium.training.reinforcement.frontier_policy import FrontierPolicy, FrontierRanking  # noqa: E402

ALL = ["frontiers", "frontier_gains", "teammates", "time_left", "coverage", "velocity", "bumper"]
TEAM = {"level": "frontier", "observe": ALL, "robots": 3, "horizon_s": 60.0, "decision_period_s": 2.0}


@pytest.fixture(scope="module")
def decisions():
    """The space and 60 observations of robots that choose at random."""
    env = lidarium.sb3_vec_env(4, "apartment:7", **TEAM, starts="fixed")
    seen, rows, generator = env.reset(), [], np.random.default_rng(0)
    for _ in range(5):
        rows.append({name: array.copy() for name, array in seen.items()})
        actions = [generator.choice(np.flatnonzero(mask)) for mask in seen["action_mask"]]
        seen = env.step(np.array(actions))[0]
    env.close()
    return env.observation_space, {
        name: torch.from_numpy(np.concatenate([row[name] for row in rows]).astype(np.float32)) for name in rows[0]
    }


@pytest.fixture
def ranking(decisions):
    """A network whose corrections are not zero."""
    torch.manual_seed(0)
    ranking = FrontierRanking(decisions[0])
    for layer in (ranking.correction, ranking.stay, ranking.critic[2]):
        torch.nn.init.normal_(layer.weight)
    return ranking


def test_it_begins_with_the_ranking_of_explore_lite(decisions):
    space, seen = decisions
    found = FrontierRanking(space)(seen).detach().numpy()
    assert found.shape == (60, space["action_mask"].shape[0] + 1)
    for ranks, mask, frontiers in zip(
        found[:, :-1], seen["action_mask"].numpy() > 0, seen["frontiers"].numpy(), strict=True
    ):
        costs = 3.0 * frontiers[:, 2] - frontiers[:, 3]
        allowed = np.flatnonzero(mask)
        best = allowed[np.argmax(ranks[allowed])]
        if mask[:-1].any():
            assert best == np.argmin(np.where(mask[:-1], costs, np.inf))
        else:
            assert best == len(mask) - 1
    assert (found[:, -1] == 0.0).all()


def test_the_order_of_what_is_seen_changes_nothing_but_the_order(decisions, ranking):
    seen = {name: array.clone() for name, array in decisions[1].items()}
    count = int(seen["action_mask"][0, :-1].sum())
    assert count > 2
    alone = {name: array[:1] for name, array in seen.items()}
    turned = {name: array.clone() for name, array in alone.items()}
    for name in ("frontiers", "frontier_gains"):
        turned[name][0, :count] = alone[name][0, :count].flip(0)
    turned["teammates"] = alone["teammates"].flip(1)
    first, second = ranking(alone)[0], ranking(turned)[0]
    torch.testing.assert_close(first[:count].flip(0), second[:count])
    torch.testing.assert_close(first[-2:], second[-2:])


def test_decisions_do_not_depend_on_those_beside_them(decisions, ranking):
    """Batches are ranked in groups, each as wide as its widest decision."""
    seen = decisions[1]
    many = {name: array.repeat(4, *[1] * (array.ndim - 1)) for name, array in seen.items()}
    together = ranking(many)[:60]
    alone = torch.cat([ranking({name: array[k : k + 1] for name, array in seen.items()}) for k in range(60)])
    mask = seen["action_mask"] > 0
    torch.testing.assert_close(together[:, :-1][mask], alone[:, :-1][mask], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(together[:, -1], alone[:, -1], atol=1e-4, rtol=1e-4)


def test_it_learns_and_opens_again(tmp_path):
    def learned():
        options = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 20.0}
        env = lidarium.sb3_vec_env(4, "apartment:7", **{"starts": "fixed", **options})
        model = sb3_contrib.MaskablePPO(FrontierPolicy, env, n_steps=8, batch_size=16, n_epochs=2, seed=0)
        before = [parameter.detach().clone() for parameter in model.policy.parameters()]
        model.learn(64)
        changed = [
            not torch.equal(old, new)
            for old, new in zip(before, model.policy.parameters(), strict=True)
            if new.numel() > 1
        ]
        assert np.mean(changed) > 0.9
        seen = env.reset()
        return model, seen, model.predict(seen, action_masks=seen["action_mask"], deterministic=True)[0]

    model, seen, chosen = learned()
    model.save(tmp_path / "model.zip")
    opened = sb3_contrib.MaskablePPO.load(tmp_path / "model.zip")
    again = opened.predict(seen, action_masks=seen["action_mask"], deterministic=True)[0]
    np.testing.assert_array_equal(again, chosen)
    np.testing.assert_array_equal(learned()[2], chosen)


def test_what_it_cannot_see_is_refused():
    from gymnasium import spaces

    box = spaces.Box(-1.0, 1.0, (4,))
    with pytest.raises(ValueError, match=r"there are none to observe; make .* with level=\"frontier\""):
        FrontierRanking(box)
    with pytest.raises(ValueError, match="none to observe"):
        FrontierRanking(spaces.Dict({"time_left": box}))
    space = {"frontiers": spaces.Box(-1.0, 1.0, (8, 4)), "action_mask": spaces.Box(0, 1, (9,)), "map": box}
    with pytest.raises(ValueError, match="does not see 'map'; observe some of frontiers, frontier_gains"):
        FrontierRanking(spaces.Dict(space))


def test_a_central_critic_sees_the_true_state_and_preferences_do_not():
    pytest.importorskip("stable_baselines3", reason='stable-baselines3 is not installed: extra "rl"')
    from lidarium.training.reinforcement.central_state import CentralState

    plain = lidarium.sb3_vec_env(2, "apartment:7", **{**TEAM, "horizon_s": 4.0, "state_cells": 4}, starts="fixed")
    env = CentralState(plain)
    seen = env.reset()
    assert seen["state"].shape == (6, *plain.state().shape[1:])
    torch.manual_seed(0)
    ranking = FrontierRanking(env.observation_space)
    for layer in (ranking.correction, ranking.stay, ranking.critic[2]):
        torch.nn.init.normal_(layer.weight)
    tensors = {name: torch.from_numpy(array.astype(np.float32)) for name, array in seen.items()}
    other = {**tensors, "state": tensors["state"] + 1.0}
    without = {name: array for name, array in tensors.items() if name != "state"}
    assert torch.equal(ranking(tensors)[:, :-1], ranking(other)[:, :-1])
    assert not torch.equal(ranking(tensors)[:, -1], ranking(other)[:, -1])
    assert torch.equal(ranking.preferences(without), ranking(tensors)[:, :-1])
    left = 3 * 7 + 2  # 7 numbers of each robot, then side, coverage and the share of the horizon that is left
    for wanted in (0.5, 1.0):  # the second decision ends the episodes, and they have begun again
        seen, _, dones, infos = env.step(np.full(6, seen["action_mask"].shape[1] - 1))
        np.testing.assert_array_equal(seen["state"], plain.state().repeat(3, axis=0))
        assert (seen["state"][:, left] == wanted).all()
    assert dones.all()
    assert [info["terminal_observation"]["state"][left] for info in infos] == [0.0] * 6
    env.close()
