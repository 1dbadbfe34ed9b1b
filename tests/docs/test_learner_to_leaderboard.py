"""The tutorial from learners to the leaderboard runs as it stands, with shorter trainings."""

import importlib.util
import re
import shlex
import sys
from pathlib import Path

import pytest

from lidarium.scripts.main import main

pytest.importorskip("torch", reason="torch is not installed: extra [rl]")
pytestmark = pytest.mark.filterwarnings("ignore")  # of BenchMARL and TorchRL, about versions

PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "learner_to_leaderboard.md"
SHORTER = {
    '"set:train:1000"': '"scene_room"',
    "updates=100": "updates=1, episodes=2, rollout=4",
    '"max_n_frames": 60_000': '"max_n_iters": 1, "on_policy_collected_frames_per_batch": 20',
    "set:test:16": "scene_room",
    "--horizon-s 60": "--horizon-s 4 --workers 1",
}


def blocks(kind):
    text = PAGE.read_text("utf-8")
    for long, short in SHORTER.items():
        assert long in text
        text = text.replace(long, short)
    return re.findall(rf"^```{kind}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def run(program):
    exec(compile(program, str(PAGE), "exec"), {"__name__": "tutorial"})


def test_networks_of_two_learners_come_to_one_page(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("ppo", "benchmarl_task"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    (copy, (evaluate, report), _) = (block.strip().splitlines() for block in blocks("bash"))
    assert main(shlex.split(copy[1])[1:]) == 0
    train_ppo, my_ppo, train_mappo, my_mappo = blocks("python")
    (tmp_path / "my_ppo.py").write_text(my_ppo)
    (tmp_path / "my_mappo.py").write_text(my_mappo)
    run(train_ppo)
    if importlib.util.find_spec("benchmarl") is not None:
        run(train_mappo)
    else:  # the actor alone, as it is before a training
        from safetensors.torch import save_file
        from torch import nn

        layers = nn.Linear(128, 256), nn.Tanh(), nn.Linear(256, 256), nn.Tanh(), nn.Linear(256, 33)
        save_file(nn.Sequential(*layers).state_dict(), "mappo.safetensors")
    for command in (evaluate, report):
        assert main(shlex.split(command)[1:]) == 0
    page = (tmp_path / "runs" / "learners" / "report" / "report.md").read_text("utf-8")
    for policy in ("my_ppo:MyPPO", "my_mappo:MyTeam", "nearest_frontier", "tour_frontier"):
        assert policy in page
    assert (tmp_path / "runs" / "learners" / "report" / "report.html").exists()


def test_pytorch_prefers_what_benchmarl_prefers(tmp_path, monkeypatch):
    """The actor is rebuilt without BenchMARL: layers, their activation and the order of what is observed."""
    pytest.importorskip("benchmarl", reason="benchmarl is not installed: extra [benchmarl]")
    import numpy as np
    import torch
    from trainer_scripts import script

    monkeypatch.chdir(tmp_path)
    task = script("benchmarl_task", "benchmarl", "benchmarl")
    config = {"evaluation": False, "save_folder": str(tmp_path)}
    made = task.experiment({"floor": "scene_room"}, task.MappoConfig.get_from_yaml(), config=config)
    from safetensors.torch import save_file

    weights = {name.rpartition("params.")[2]: each.detach() for name, each in made.policy.named_parameters()}
    save_file(weights, "mappo.safetensors")
    scope = {}
    exec(blocks("python")[3], scope)
    mine, seen = scope["MyTeam"](), made.test_env.reset()
    theirs = made.policy(seen)["robot", "logits"]
    observed = seen["robot", "observation", "observation"]
    assert torch.allclose(mine.actor(observed), theirs, atol=1e-5)
    env = task.lidarium.parallel_env(**{**task.TEAM, "floor": "scene_room"})
    plain = env.reset(seed=0)[0]["robot_0"]
    flat = task.lidarium.parallel_env(**{**task.TEAM, **task.FORMS, "action_mask": "beside", "floor": "scene_room"})
    assert np.array_equal(plain["frontiers"].ravel(), flat.reset(seed=0)[0]["robot_0"]["observation"])
