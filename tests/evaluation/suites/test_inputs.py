"""What the results of an evaluation depend on besides its settings: own files, and what fails after an episode."""

import json
import sys

import numpy as np
import pytest

import lidarium
from lidarium.evaluation.episodes.settings_identity import settings_sha256
from lidarium.registry import registry
from lidarium.scripts.main import main

SHORT = ["--robots", "1", "--horizon-s", "2", "--workers", "1"]
POLICY = """
import lidarium

class Mine(lidarium.Policy):
    level = "velocity"
    observes = ("time_left",)

    def reset(self, team, seed=0):
        pass

    def act(self, observations):
        return {agent: [0.2, 0.0] for agent in observations}
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def evaluate(*more, seeds=1):
    return main(["evaluate", *more, *SHORT, "--seeds", str(seeds), "--out", "out"])


def test_a_policy_that_observes_more_is_reported_beside_the_others(here):
    (here / "observes_more.py").write_text(POLICY)
    assert evaluate("--policies", "observes_more:Mine", "random_walk") == 0
    assert main(["report", "out"]) == 0


def test_what_is_observed_is_no_part_of_the_world_but_all_else_is():
    plain = lidarium.make_settings()
    assert settings_sha256(lidarium.make_settings(observe=("scan", "pose"))) == settings_sha256(plain)
    assert settings_sha256(lidarium.make_settings(time_step=0.05)) != settings_sha256(plain)


@pytest.mark.parametrize("changed", ["policy", "floor", "weights"])
def test_an_evaluation_does_not_go_on_after_a_file_that_it_depends_on_has_changed(here, changed, capsys):
    import imageio.v3 as imageio

    picture = np.full((80, 80), 255, np.uint8)
    picture[[0, -1]] = picture[:, [0, -1]] = 0
    imageio.imwrite(here / "room.png", picture)
    (here / f"own_{changed}.py").write_text(
        POLICY.replace("pass", "pass\n\n    def __init__(self, weights=''):\n        pass")
    )
    (here / "weights.bin").write_bytes(b"1")
    name = f"own_{changed}:Mine"
    asked = ["--policies", name, "--policy-set", f"{name}.weights=weights.bin", "--floors", "room.png"]
    asked += ["--resolution", "0.1"]
    assert evaluate(*asked) == 0
    assert evaluate(*asked, seeds=2) == 0, "unchanged files are no obstacle"
    if changed == "policy":
        (here / f"own_{changed}.py").write_text(POLICY)
    elif changed == "floor":
        picture[40, 20:60] = 0
        imageio.imwrite(here / "room.png", picture)
    else:
        (here / "weights.bin").write_bytes(b"2")
    capsys.readouterr()
    before = (here / "out" / "episodes.jsonl").read_bytes()
    assert evaluate(*asked, seeds=3) == 2
    said = capsys.readouterr().err
    assert "before its file changed" in said
    assert ("room.png" if changed == "floor" else name) in said
    assert (here / "out" / "episodes.jsonl").read_bytes() == before


def test_a_metric_that_fails_loses_no_episode(here, capsys):
    @lidarium.metric("failing", unit="m", summary="always fails")
    def failing(episode):
        raise KeyError("no such wall")

    try:
        assert evaluate("--policies", "random_walk") == 4
        assert "metric 'failing' failed in 1 of 1 episodes: KeyError: 'no such wall'" in capsys.readouterr().err
        run = ["run", "--policy", "random_walk", "--robots", "1", "--horizon-s", "2", "--out", "run"]
        assert main(run) == 4
    finally:
        registry("metric").unregister("failing")
    for row in (
        json.loads((here / "out" / "episodes.jsonl").read_text()),
        json.loads((here / "run/result.json").read_text()),
    ):
        assert row["failing"] is None
        assert row["failed_metrics"] == {"failing": "KeyError: 'no such wall'"}
        assert row["coverage_final"] > 0.0


def test_a_metric_that_no_file_can_hold_loses_no_episode(here):
    lidarium.metric("mean_wait_s", unit="s", summary="mean of nothing")(lambda _: np.float64("nan"))
    try:
        assert evaluate("--policies", "random_walk") == 4
    finally:
        registry("metric").unregister("mean_wait_s")
    row = json.loads((here / "out" / "episodes.jsonl").read_text())
    assert row["mean_wait_s"] is None
    assert row["failed_metrics"]["mean_wait_s"].startswith("ValueError: Out of range float values")


def test_a_report_that_fails_loses_no_episode(here, capsys):
    (here / "fails_at_the_end.py").write_text(f"{POLICY}\n    def report(self):\n        raise KeyError('no record')\n")
    assert evaluate("--policies", "fails_at_the_end:Mine") == 4
    run = ["run", "--policy", "fails_at_the_end:Mine", "--robots", "1", "--horizon-s", "2", "--out", "run"]
    assert main(run) == 4
    assert "report failed: KeyError: 'no record'" in capsys.readouterr().err
    for path in (here / "out" / "episodes.jsonl", here / "run" / "result.json"):
        row = json.loads(path.read_text())
        assert row["failed_metrics"] == {"report": "KeyError: 'no record'"}
        assert row["coverage_final"] > 0.0
    assert (here / "run" / "run.png").exists()


def test_a_bound_that_fails_loses_no_episode_and_a_missing_solver_is_told_before(here, monkeypatch, capsys):
    def fails(*_):
        raise ValueError("no tour")

    monkeypatch.setattr("lidarium.evaluation.bounds.bound.known_floor_bound", fails)
    assert evaluate("--policies", "random_walk", "--bounds") == 4
    row = json.loads((here / "out" / "episodes.jsonl").read_text())
    assert (row["bound_s"], row["failed_metrics"]) == (None, {"bound_s": "ValueError: no tour"})
    assert row["coverage_final"] > 0.0
    monkeypatch.setitem(sys.modules, "ortools.constraint_solver", None)
    capsys.readouterr()
    assert evaluate("--policies", "random_walk", "--bounds", seeds=2) == 2
    assert "bounds need OR-Tools: pip install" in capsys.readouterr().err


def test_a_map_that_settings_name_is_an_input(here, capsys):
    known = here / "known.npz"
    splines = ["--localization", "splines", "--policy", "random_walk", "--robots", "1"]
    for seconds in ("1", "3"):
        assert main(["run", *splines, "--horizon-s", seconds, "--out", "run"]) == 0
        known.write_bytes((here / "run" / "robot_0_splines.npz").read_bytes())
        capsys.readouterr()
        asked = ["--localization", "splines", "--set", "localizer.tracking.start_map=known.npz"]
        assert evaluate("--policies", "random_walk", *asked) == (0 if seconds == "1" else 2)
    assert "episodes of settings 'default' as it was before its file changed" in capsys.readouterr().err


def test_settings_of_a_localizer_come_to_a_result(here):
    options = ["--localization", "slam", "--set", "localizer.matching.wide_share=0.1"]
    assert main(["run", "--policy", "random_walk", "--robots", "1", "--horizon-s", "2", "--out", "run", *options]) == 0
    assert json.loads((here / "run/result.json").read_text())["realism"] == "custom"


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("srt", "mod=thesis", "unknown setting 'mod'; did you mean 'mode'"),
        ("own_without:Mine", "weights=a", "unknown setting 'weights' (known: none)"),
        ("own_needing:Mine", None, "policy 'own_needing:Mine' needs the setting 'weights'"),
    ],
)
def test_wrong_settings_of_policies_are_answered_in_one_line(here, name, given, said, capsys):
    (here / "own_without.py").write_text(POLICY)
    (here / "own_needing.py").write_text(POLICY + "\n    def __init__(self, weights):\n        pass\n")
    chosen = [] if given is None else ["--policy-set", given]
    assert main(["run", "--policy", name, "--robots", "1", "--out", "run", *chosen]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert "Traceback" not in error


HOSTILE = """
policies = ["{name}"]
floors = ["apartment"]
"""


@pytest.mark.parametrize("table", [False, True])
def test_a_suite_file_calls_nothing_that_it_names(here, table, capsys):
    marker = here / "ran"
    command = f'command = "touch {marker}"'
    if table:
        text = f'policies = ["a"]\nfloors = ["apartment"]\n[policy_settings.a]\npolicy = "os:system"\n{command}\n'
    else:
        text = HOSTILE.format(name="os:system") + f'[policy_settings."os:system"]\n{command}\n'
    (here / "suite.toml").write_text(text)
    for flag, said in (([], "want --own-policies if you trust the file"), (["--own-policies"], "want a subclass")):
        assert main(["evaluate", "suite.toml", "--out", "out", *flag]) == 2
        assert said in capsys.readouterr().err
    assert not marker.exists()
    assert not (here / "out" / "episodes.jsonl").exists()


def test_a_module_that_a_suite_names_is_imported_only_if_it_is_allowed(here, capsys):
    (here / "leaves_a_mark.py").write_text("open('mark', 'w').close()\n" + POLICY)
    (here / "suite.toml").write_text(HOSTILE.format(name="leaves_a_mark:Mine") + "[settings]\nhorizon_s = 1.0\n")
    assert main(["evaluate", "suite.toml", "--out", "out", "--workers", "1"]) == 2
    assert not (here / "mark").exists()
    assert main(["evaluate", "suite.toml", "--out", "out", "--workers", "1", "--own-policies"]) == 0
    assert (here / "mark").exists()
