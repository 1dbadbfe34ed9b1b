import json

import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.result import result_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.scripts.main import main


@pytest.fixture
def folder(tmp_path):
    env = ExplorationEnv("apartment", make_settings(robots=1, resolution=0.05, horizon_s=20.0))
    result = result_of(run_episode(lidarium.policy("random_walk"), env, 0), "random_walk")
    lines = [
        json.dumps({**result, "policy": policy, "seed": seed})
        for policy in ("random_walk", "explore_lite")
        for seed in (0, 1)
    ]
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    return tmp_path / "in"


def test_the_report_lies_beside_the_episodes_and_its_figures_are_told(folder, capsys):
    assert main(["report", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "1 robot, drawn floors" in told
    assert (
        "careful: 1 robot, drawn floors: fewer than 50 independent runs of `explore_lite` (2), `random_walk` (2)"
        in told
    )
    assert f"written to {folder / 'report'}" in told
    assert (folder / "report" / "report.md").is_file()


def test_json_is_what_is_written(folder, tmp_path, capsys):
    assert (
        main(
            [
                "report",
                str(folder),
                "--out",
                str(tmp_path / "out"),
                "--json",
                "--baseline",
                "random_walk",
                "--seed",
                "5",
            ]
        )
        == 0
    )
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((tmp_path / "out" / "report.json").read_text())
    assert (result["baseline"], result["seed"]) == ("random_walk", 5)
    assert not (folder / "report").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--baseline", "best"], "--baseline is 'best'"),
        (["--out", "episodes.jsonl/out"], "is not a folder"),
    ],
)
def test_bad_input_is_refused(folder, capsys, monkeypatch, arguments, message):
    monkeypatch.chdir(folder)
    assert main(["report", str(folder), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["episodes.jsonl"]


def test_a_folder_without_episodes_is_refused(tmp_path, capsys):
    assert main(["report", str(tmp_path)]) == 2
    assert "want a folder that `lidarium evaluate --out` wrote" in capsys.readouterr().err
