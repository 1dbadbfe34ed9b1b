"""A record tells what robots observed, and how they were driven."""

import numpy as np
import pytest

from lidarium.agents import Policy
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, read_record, write_record
from lidarium.evaluation.record.demonstrations import write_demonstrations
from lidarium.scripts.main import main


class Wanders(Policy):
    """Drives by chance, and keeps what it saw and did."""

    level = "velocity"

    def reset(self, team, seed=0):
        self.seen, self.done, self.generator = [], [], np.random.default_rng(seed)

    def act(self, observations):
        shares = {agent: self.generator.uniform(-1.0, 1.0, 2).astype(np.float32) for agent in observations}
        self.seen.append({agent: {k: np.array(v) for k, v in each.items()} for agent, each in observations.items()})
        self.done.append(shares)
        return shares


@pytest.fixture
def recorded(tmp_path):
    recorder, policy = Recorder("wanders", 4, "apartment"), Wanders()
    settings = make_settings(robots=2, horizon_s=3.0, resolution=0.05, noise="datasheet")
    run_episode(policy, WatchedExploration("apartment", settings, watchers=[recorder]), 4)
    write_record(tmp_path / "episode.npz", recorder.finish())
    return tmp_path / "episode.npz", policy


def test_observations_and_actions_are_those_of_the_run(recorded, tmp_path):
    path, policy = recorded
    write_demonstrations(tmp_path / "shown.npz", read_record(path))
    with np.load(tmp_path / "shown.npz", allow_pickle=False) as found:
        for agent in ("robot_0", "robot_1"):
            np.testing.assert_allclose(
                found[f"{agent}/actions"], [done[agent] for done in policy.done], rtol=0.0, atol=1e-6
            )
            for name in policy.seen[0][agent]:
                expected = np.stack([seen[agent][name] for seen in policy.seen])
                np.testing.assert_array_equal(found[f"{agent}/{name}"], expected)
                assert found[f"{agent}/{name}"].dtype == expected.dtype
        assert len(found.files) == 2 * (1 + len(policy.seen[0]["robot_0"]))


def test_the_command_writes_them(recorded, tmp_path, capsys):
    path, _ = recorded
    out = tmp_path / "new" / "shown.npz"
    assert main(["replay", str(path), "--demonstrations", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    with np.load(out, allow_pickle=False) as found:
        assert found["robot_0/actions"].shape == (30, 2)
