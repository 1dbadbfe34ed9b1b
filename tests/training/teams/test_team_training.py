"""Trainings of teams by rewards, into a folder."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason='PyTorch is not installed: extra "rl"')
pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: extra "rl"')

import lidarium  # noqa: E402
from lidarium.agents.zoo.network import NETWORKS, OBSERVED, network_shapes  # noqa: E402
from lidarium.agents.zoo.policy import zoo_files  # noqa: E402
from lidarium.envs.faces.makers import sb3_vec_env  # noqa: E402
from lidarium.scripts.commands.train import _team_answer  # noqa: E402
from lidarium.scripts.main import main  # noqa: E402
from lidarium.training.settings import TeamSettings, read_any_training  # noqa: E402
from lidarium.training.teams.training import (  # noqa: E402
    CARD_FILE,
    CHECKPOINTS,
    CURVE_FILE,
    POLICIES,
    TRAINING_FILE,
    WEIGHTS_FILE,
    TeamTraining,
)

TINY = """
seed = 3
[team]
robots = 2
floors = "apartment"
horizon_s = 20.0
validation = "validation:2"
[ppo]
decisions = 32
checkpoint = 16
environments = 4
steps = 4
batch = 8
epochs = 1
learning_rate = 0.01
"""


VALUES = """
seed = 3
[team]
algorithm = "qmix"
robots = 2
floors = "apartment"
horizon_s = 20.0
validation = "validation:2"
[value]
decisions = 64
checkpoint = 32
environments = 4
batch = 4
learning_rate = 0.01
"""

ALGORITHMS = {
    "ppo": TINY,
    "tours": TINY.replace("robots = 2", 'robots = 2\nlevel = "tour"'),
    "mappo": TINY.replace("robots = 2", 'robots = 2\nalgorithm = "mappo"'),
    "supervised": TINY.replace("robots = 2", "robots = 2\nsupervisor = { merge_period_s = 4.0 }"),
    "qmix": VALUES,
    "vdn": VALUES.replace("qmix", "vdn"),
}


def settings_of(text, tmp_path):
    path = tmp_path / "team.toml"
    path.write_text(text)
    return read_any_training(path)


def files_of_checkpoint(settings, folder, decisions):
    """The weights of a checkpoint."""
    return zoo_files("", settings.level).load(folder / CHECKPOINTS / f"decisions-{decisions:09d}.safetensors")


@pytest.fixture(scope="module", params=ALGORITHMS)
def whole(request, tmp_path_factory):
    """A training of two updates that was never interrupted."""
    if "[value]" in ALGORITHMS[request.param]:
        pytest.importorskip("torchrl", reason='TorchRL is not installed: extra "torchrl"')
    folder = tmp_path_factory.mktemp(request.param)
    settings = settings_of(ALGORITHMS[request.param], folder)
    return settings, folder / "run", list(TeamTraining(settings, folder / "run").run())


def test_two_updates_have_a_curve_a_card_and_the_best_weights(whole):
    settings, folder, steps = whole
    half = settings.learning.checkpoint
    assert [(step.part, step.done) for step in steps] == [
        ("rewards", 0),
        ("rewards", half),
        ("rewards", 2 * half),
        ("best weights", 1),
    ]
    card = json.loads((folder / CARD_FILE).read_text())
    curve = card["curve"]
    assert card["training"]["algorithm"] == settings.algorithm
    assert [number for number, _ in curve] == [0, half, 2 * half]
    assert all(0.0 < coverage < 1.0 for _, coverage in curve)
    assert card["best"]["coverage"] == max(coverage for _, coverage in curve[1:])
    assert (folder / CURVE_FILE).read_text().splitlines()[0] == "step,coverage"
    best = files_of_checkpoint(settings, folder, card["best"]["decisions"])
    for name, array in zoo_files("", settings.level).load(folder / WEIGHTS_FILE).items():
        np.testing.assert_array_equal(array, best[name].astype(np.float16), name)


def test_both_checkpoints_have_learned(whole):
    settings, folder, _ = whole
    weights = [files_of_checkpoint(settings, folder, k * settings.learning.checkpoint) for k in (1, 2)]
    for name in ("correction.weight", f"{settings.level}.weight", "steepness"):
        assert not np.array_equal(weights[0][name], weights[1][name]), name


def test_a_training_that_goes_on_after_a_kill_is_equal(whole, tmp_path):
    settings, folder, _ = whole
    half = settings.learning.checkpoint
    steps = TeamTraining(settings, tmp_path / "run").run()
    assert next(steps).done == 0
    assert next(steps).done == half
    steps.close()
    list(TeamTraining(settings, tmp_path / "run").run())
    for name in (CARD_FILE, CURVE_FILE, WEIGHTS_FILE, f"{CHECKPOINTS}/decisions-{2 * half:09d}.learner.safetensors"):
        assert (tmp_path / "run" / name).read_bytes() == (folder / name).read_bytes(), name


def test_a_finished_training_is_not_run_again(whole):
    settings, folder, _ = whole
    before = (folder / WEIGHTS_FILE).read_bytes()
    assert [step.part for step in TeamTraining(settings, folder).run()] == ["rewards", "best weights"]
    assert (folder / WEIGHTS_FILE).read_bytes() == before


def test_missing_weights_are_named(tmp_path):
    settings = settings_of(TINY, tmp_path)
    steps = TeamTraining(settings, tmp_path / "run").run()
    assert [next(steps).done, next(steps).done] == [0, 16]
    steps.close()
    (tmp_path / "run" / WEIGHTS_FILE).unlink()
    with pytest.raises(FileNotFoundError, match="the best weights so far, is missing; put a copy back"):
        next(TeamTraining(settings, tmp_path / "run").run())


def test_damaged_weights_and_requests_are_named_with_a_cure(whole, tmp_path):
    settings, folder, _ = whole
    shutil.copytree(folder, tmp_path / "run")
    for name in (WEIGHTS_FILE, TRAINING_FILE):
        path = tmp_path / "run" / name
        path.write_bytes(path.read_bytes()[:100])
        with pytest.raises(ValueError, match=rf"{name}.*; put a copy back, or choose another folder"):
            list(TeamTraining(settings, tmp_path / "run").run())


def test_a_team_under_a_supervisor_is_used_under_one(tmp_path):
    weights = {name: np.zeros(shape, np.float32) for name, shape in network_shapes("frontier").items()}
    zoo_files("", "frontier").save(tmp_path / WEIGHTS_FILE, weights)
    asked = {"level": "frontier", "robots": 2, "supervisor": {"merge_period_s": 4.0}}
    best = {"decisions": 32, "coverage": 0.5}
    card = {"training": asked, "decisions": 32, "best": best, "untrained": {"coverage": 0.25}}
    (tmp_path / CARD_FILE).write_text(json.dumps(card))
    text = _team_answer(tmp_path, False).text
    assert "lidarium run" not in text
    names = {"lidarium": lidarium}
    exec(text.partition("from unknown starts:\n")[2].replace("robots=2", "robots=2, horizon_s=1.0"), names)
    assert names["policy"].settings.merge_period_s == 4.0
    assert not names["env"].settings.known_starts
    assert names["env"].scorer.time == 1.0


def test_a_training_does_not_go_on_with_another_floor_of_the_same_name(tmp_path):
    thresholds = "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    (tmp_path / "floor.yaml").write_text(f"image: floor.pgm\nresolution: 0.5\norigin: [0, 0, 0]\n{thresholds}")
    settings = settings_of(TINY.replace('"apartment"', f"'{tmp_path / 'floor.yaml'}'"), tmp_path)
    for cells in (b"\xfe" * 380 + b"\x00" * 20, b"\x00" * 20 + b"\xfe" * 380):
        (tmp_path / "floor.pgm").write_bytes(b"P5 20 20 255\n" + cells)
        steps = TeamTraining(settings, tmp_path / "run").run()
        if cells[0]:
            next(steps)
            steps.close()
    with pytest.raises(ValueError, match=r"holds a training with inputs\..*floor.yaml = .*choose another folder"):
        next(steps)


def test_a_team_counts_until_its_last_robot_ends(monkeypatch):
    class Team:
        num_envs = 2
        engine = SimpleNamespace(level=SimpleNamespace(period_s=10.0))

        def reset(self, **_):
            self.coverages = iter(([0.25, 0.25], [0.5, 0.5], [0.0, 0.0]))
            self.ended = iter(([True, False], [False, True], [False, False]))
            return {}, {"truth": {"coverage": np.zeros(2)}}

        def step(self, _):
            ended = np.array(next(self.ended))
            return {}, None, ended, np.zeros(2, np.bool_), {"truth": {"coverage": np.array(next(self.coverages))}}

        def close(self):
            pass

    monkeypatch.setattr("lidarium.training.teams.training.vector_env", lambda *_, **__: Team())
    training = TeamTraining(TeamSettings(horizon_s=30.0, validation="validation:1"), None)
    network = SimpleNamespace(preferred=lambda _: np.zeros(2, np.int64))
    assert training._validated(network) == pytest.approx((0.25 + 0.5 + 0.5) / 3.0)


@pytest.mark.parametrize("level", OBSERVED)
def test_numpy_decides_as_torch(level):
    generator = np.random.default_rng(0)
    drawn = {name: generator.normal(0.0, 0.2, shape) for name, shape in network_shapes(level).items()}
    weights = {name: array.astype(np.float32) for name, array in drawn.items()}
    env = sb3_vec_env(4, "apartment:7", level=level, **TeamSettings(level=level).options("fast"))
    seen, policy = env.reset(), POLICIES[level]
    ranking = policy.ranking(env.observation_space)
    ranking.set_weights(weights)
    network = NETWORKS[level](weights)
    most = 0
    for _ in range(5):
        tensors = {name: torch.from_numpy(array.astype(np.float32)) for name, array in seen.items()}
        wanted = ranking(tensors).detach().numpy()[:, :-1]
        holes = generator.random(seen["action_mask"].shape) < 0.3
        holes[:, -1] = False
        gaps = {**seen, "action_mask": np.where(holes, 0, seen["action_mask"])}  # as a wrapper may forbid some
        tensors["action_mask"] = torch.from_numpy(gaps["action_mask"].astype(np.float32))
        barred = ranking(tensors).detach().numpy()[:, :-1]
        for row, mask in enumerate(gaps["action_mask"] > 0):
            found = network.preferences({name: array[row] for name, array in gaps.items()})
            np.testing.assert_allclose(found[mask], barred[row][mask], rtol=1e-3, atol=1e-3)
        for row, mask in enumerate(seen["action_mask"] > 0):
            found = network.preferences({name: array[row] for name, array in seen.items()})
            np.testing.assert_allclose(found[mask], wanted[row][mask], rtol=1e-3, atol=1e-3)
            most = max(most, int(mask.sum()))
        seen = env.step(np.array([generator.choice(np.flatnonzero(mask)) for mask in seen["action_mask"]]))[0]
    assert most > 3
    env.close()


def test_before_a_training_a_team_does_as_tours_do():
    zeros = {name: np.zeros(shape, np.float32) for name, shape in network_shapes("tour").items()}
    network = NETWORKS["tour"]({**zeros, "steepness": np.ones(1, np.float32)})
    env = sb3_vec_env(2, "apartment:7", level="tour", **TeamSettings(level="tour").options("fast"))
    seen = env.reset()
    for _ in range(40):
        chosen = [network.choose({name: array[row] for name, array in seen.items()}) for row in range(4)]
        assert chosen == [0] * 4
        seen = env.step(np.array(chosen))[0]
    env.close()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("robots = 2", "robots = 1", "robots of team is 1"),
        ("robots = 2", "robots = 3", "whole multiple of the 3 robots"),
        ("robots = 2", 'robots = 2\nalgorithm = "dqn"', "algorithm of team is 'dqn'; want ppo or mappo or qmix or vdn"),
        ("robots = 2", 'robots = 2\nlevel = "velocity"', "level of team is 'velocity'; want frontier or tour"),
        ("robots = 2", "robots = 2\nsettings = { observe = ['scan'] }", "settings of team has 'observe'"),
        ("decisions = 32", "decisions = 0", "decisions of ppo is 0"),
        ("seed = 3", "seed = 3\nfit = {}", "a training of teams by ppo has no 'fit'"),
        ("robots = 2", 'robots = 2\nalgorithm = "qmix"', "a training of teams by qmix has no 'ppo'"),
        ("robots = 2", 'robots = 2\nsupervisor = {}\nalgorithm = "mappo"', "under a supervisor is 'mappo'; want ppo"),
        (
            "robots = 2",
            "robots = 2\nsupervisor = { merge_s = 1 }",
            "team has no 'merge_s'; it has period_s",
        ),
        ("[ppo]", "[value]", "a training of teams by ppo has no 'value'"),
        ('"validation:2"', '"castle:3"', "castle"),
        ('"validation:2"', '"apartment"', "validation of team is not a set of floors"),
        ("[team]", "[team]\nseed = 4", "seed is 3 at the top and 4 in [team]; want one"),
        ('"apartment"', '"set:train:0"', "'train:0' wants '0' floors"),
        ("robots = 2", 'robots = 2\nrealism = "fsat"', "fsat"),
        ("robots = 2", "robots = 2\nsettings = { reward = { more = { nix = 1 } } }", "unknown reward term 'nix'"),
        ("robots = 2", "robots = 2\nsettings = { scan_period_s = 5.0 }", "longer than a decision"),
        ("[ppo]", "[team.ppo]", "team has the table 'ppo'; want [ppo], beside [team]"),
    ],
)
def test_bad_settings_are_refused_before_anything_is_written(old, new, words, tmp_path, capsys):
    path = tmp_path / "team.toml"
    path.write_text(TINY.replace(old, new))
    assert main(["train", str(path), "--out", str(tmp_path / "run")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("new", "words"),
    [
        ("batch = 4\nkept = 3", "kept of value is 3; want at least the batch, 4"),
        ("batch = 16", "checkpoint of value is 32; want at least twice batch times robots, 64"),
    ],
)
def test_values_that_would_never_be_learned_are_refused(new, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        settings_of(VALUES.replace("batch = 4", new), tmp_path)


def test_trainings_that_ship_are_listed_and_can_be_read(capsys):
    assert main(["train", "--list"]) == 0
    text = capsys.readouterr().out
    assert "ppo-2" in text
    assert "ppo-4" in text
    assert main(["train"]) == 2
    assert "lidarium train --list" in capsys.readouterr().err
