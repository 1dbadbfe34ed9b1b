"""Learning curves of seeds, from every form of file that is read."""

import json

import numpy as np
import pytest

from lidarium.evaluation.analysis.learning_curves import read_curve
from lidarium.scripts.main import main


@pytest.fixture
def trainings(tmp_path):
    generator = np.random.default_rng(0)
    for seed in range(5):
        steps = np.arange(0, 1000 + 50 * seed, 50)
        rewards = steps / 1000.0 + 0.1 * generator.standard_normal(len(steps))
        lines = [f"{step},{reward},1" for step, reward in zip(steps, rewards, strict=True)]
        (tmp_path / f"ppo-{seed}.csv").write_text("\n".join(["steps,reward,other", *lines, ",,2"]))
    return tmp_path


def test_seeds_are_joined_where_all_are_known(trainings, capsys):
    pattern = f"PPO={trainings}/ppo-*.csv"
    assert main(["curves", pattern, "--x", "steps", "--y", "reward", "--out", str(trainings / "out")]) == 0
    assert "PPO" in capsys.readouterr().out
    curve = json.loads((trainings / "out" / "curves.json").read_text())["curves"]["PPO"]
    assert (curve["seeds"], curve["x"][0], curve["x"][-1]) == (5, 0.0, 950.0)
    assert np.abs(np.array(curve["mean"]) - np.array(curve["x"]) / 1000.0).max() < 0.2
    assert (np.array(curve["low"]) < curve["mean"]).all()
    assert (trainings / "out" / "curves.png").stat().st_size > 10_000


def test_json_lines_and_files_without_a_header_are_read(tmp_path):
    (tmp_path / "a.jsonl").write_text('{"step": 2, "value": 5.0}\n{"step": 1, "value": 3}\n{"other": 1}\n')
    (tmp_path / "b.csv").write_text("1,3.0\n2,5.0\n")
    for name in ("a.jsonl", "b.csv"):
        x, y = read_curve(tmp_path / name, "step", "value")
        assert (x.tolist(), y.tolist()) == ([1.0, 2.0], [3.0, 5.0])


def test_of_a_training_that_went_on_the_lines_written_again_count(tmp_path):
    steps = [0, 10, 20, 30, 40, 15, 25, 25]
    (tmp_path / "a.csv").write_text("".join(f"{step},{line}\n" for line, step in enumerate(steps)))
    x, y = read_curve(tmp_path / "a.csv", "step", "value")
    assert (x.tolist(), y.tolist()) == ([0.0, 10.0, 15.0, 25.0], [0.0, 1.0, 5.0, 7.0])


@pytest.mark.parametrize(("end", "is_early"), [(300, True), (950, False)])
def test_a_training_that_ends_early_and_cuts_others_is_named(end, is_early, tmp_path, capsys):
    for name, last in (("a", 1000), ("b", end)):
        (tmp_path / f"{name}.csv").write_text(f"0,0.0\n{last},1.0\n")
    assert main(["curves", f"A={tmp_path}/*.csv", "--json", "--out", str(tmp_path / "out")]) == 0
    captured = capsys.readouterr()
    said = f"the curves of A end at step 300, where {tmp_path / 'b.csv'} ends; the longest ends at 1000"
    assert (said in captured.err) is is_early
    assert (said in json.loads(captured.out)["remarks"]) is is_early


def test_tensorboard_folders_are_read(tmp_path):
    tensorboard = pytest.importorskip("torch.utils.tensorboard", reason="PyTorch is not installed")
    with tensorboard.SummaryWriter(str(tmp_path / "log")) as writer:
        for step in range(3):
            writer.add_scalar("reward", 2.0 * step, step)
    x, y = read_curve(tmp_path / "log", "step", "reward")
    assert (x.tolist(), y.tolist()) == ([0.0, 1.0, 2.0], [0.0, 2.0, 4.0])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["PPO"], "want NAME=PATTERN"),
        (["PPO=nowhere-*.csv"], "no file is like"),
        (["PPO={}/ppo-*.csv", "--y", "rewards"], "did you mean 'reward'"),
        (["PPO={}/ppo-*.csv", "PPO={}/ppo-*.csv"], "two kinds"),
    ],
)
def test_what_is_wrong_is_named(words, said, trainings, capsys):
    given = [word.format(trainings) for word in words]
    assert main(["curves", *given, "--x", "steps", "--out", str(trainings / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (trainings / "out" / "curves.png").exists()
