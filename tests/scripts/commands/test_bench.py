import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.benchmarks.speed import against
from lidarium.benchmarks.speed import all as benchmarks
from lidarium.benchmarks.speed.harness import timing
from lidarium.benchmarks.speed.harness.lines import Line, faster
from lidarium.scripts.main import main


@pytest.fixture
def two_questions(monkeypatch):
    """Two questions of no cost in place of all."""
    questions = {
        "rays": SimpleNamespace(
            CORES=1,
            NOTES=("*Rays*: many.",),
            measure=lambda effort: [faster("rays", [1e-3], "slow", [1e-2], 5.0)],
        ),
        "steps": SimpleNamespace(
            CORES=1,
            NOTES=("*Steps*: few.",),
            measure=lambda effort: [faster("steps", [1e-3], "absent", None, 5.0)],
        ),
    }
    monkeypatch.setattr(benchmarks, "QUESTIONS", questions)
    return questions


@pytest.fixture
def no_peers(monkeypatch):
    for variable in ("LIDARIUM_VMAS_PYTHON", "LIDARIUM_F1TENTH"):
        monkeypatch.delenv(variable, raising=False)


def test_the_table_has_every_line_and_says_how_to_get_what_is_missing(two_questions, no_peers, capsys):
    assert main(["bench"]) == 0
    told = capsys.readouterr()
    assert "10 x (10 to 10)" in told.out
    assert "absent: peer not installed" in told.out
    assert "LIDARIUM_F1TENTH" in told.out
    assert "measuring steps (2 of 2)" in told.err


def test_json_is_what_is_written_and_the_page_says_the_same(two_questions, no_peers, tmp_path, capsys):
    assert main(["bench", "--json", "--effort", "quick", "--out", str(tmp_path / "out")]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result == json.loads((tmp_path / "out" / "speed.json").read_text())
    assert [(line["name"], line["is_reached"]) for line in result["lines"]] == [
        ("rays", True),
        ("steps", None),
    ]
    assert result["command"] == "lidarium bench --effort quick"
    page = (tmp_path / "out" / "speed.md").read_text()
    assert "[speed_speed.csv](speed_speed.csv)" in page
    table = (tmp_path / "out" / "speed_speed.csv").read_text()
    assert 'rays,"1,000 agent steps/s",slow: 100,10 x (10 to 10),>= 5 x,yes' in table
    assert "- *Steps*: few." in page
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["speed.json", "speed.md", "speed_speed.csv"]


def test_single_questions_can_be_asked(two_questions, no_peers, capsys):
    assert main(["bench", "--only", "steps", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [line["name"] for line in result["lines"]] == ["steps"]
    assert "*Rays*: many." not in result["notes"]


def test_an_unknown_question_is_refused(tmp_path, capsys):
    assert main(["bench", "--only", "stairs", "--out", str(tmp_path / "out")]) == 2
    assert "unknown question 'stairs'; want some of kernel_step" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_help_names_every_question(capsys):
    assert main(["bench", "--help"]) == 0
    told = capsys.readouterr().out
    assert all(name in told for name in benchmarks.QUESTIONS)


def test_interrupted_it_keeps_the_questions_that_were_answered(two_questions, no_peers, tmp_path, capsys):
    def interrupt(effort):
        raise KeyboardInterrupt

    two_questions["steps"].measure = interrupt
    assert main(["bench", "--json", "--out", str(tmp_path)]) == 130
    result = json.loads(capsys.readouterr().out)
    assert result["interrupted"] is True
    assert [line["name"] for line in result["lines"]] == ["rays"]
    assert result == json.loads((tmp_path / "speed.json").read_text())


def test_a_vmas_interpreter_that_does_not_answer_is_bad_input(two_questions, monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("LIDARIUM_VMAS_PYTHON", str(tmp_path / "python"))
    assert main(["bench"]) == 2
    assert "want a Python interpreter with vmas and torch" in capsys.readouterr().err


def test_a_real_question_measures_and_lets_the_process_go_from_its_core(no_peers, monkeypatch, capsys):
    monkeypatch.setitem(timing.EFFORTS, "quick", timing.Effort(rounds=1, block_s=0.001))
    before = timing.cores()
    assert main(["bench", "--only", "map_update", "--effort", "quick", "--json"]) == 0
    lines = json.loads(capsys.readouterr().out)["lines"]
    assert all(line["ratio"]["median"] > 0.0 for line in lines)
    assert timing.cores() == before


def test_lines_are_judged_by_their_side():
    assert Line("error", "", "", None, 0.1, 0.05, is_upper_bound=True).is_reached
    assert not Line("error", "", "", None, 0.1, 0.2, is_upper_bound=True).is_reached
    assert Line("rate", "", "", None, 0.1, 0.2).is_reached
    assert Line("told", "", "", None, None, 0.2).is_reached is None


@pytest.fixture
def in_turn(monkeypatch):
    """A comparison in which frontier decisions take a tenth more time than in the other version."""
    found = {"waypoint decisions": np.array([[9.0, 9.0], [10.0, 10.0]]), "frontier decisions": np.ones((2, 2))}
    found["frontier decisions"][0] = 1.1
    monkeypatch.setattr(against, "times", lambda pythons, kinds, threads, rounds, blocks: found)


def test_a_guard_names_what_is_slower_than_another_version(in_turn, tmp_path, capsys):
    assert main(["bench", "--guard", sys.executable, "--json", "--out", str(tmp_path)]) == 3
    result = json.loads(capsys.readouterr().out)
    assert result["slower"] == ["frontier decisions"]
    assert [line["is_slower"] for line in result["lines"]] == [False, True]
    assert result == json.loads((tmp_path / "guard.json").read_text())
    assert main(["bench", "--guard", sys.executable]) == 3
    assert "slower than the other version: frontier decisions" in capsys.readouterr().out


def test_a_guard_that_cannot_run_is_refused(monkeypatch, tmp_path, capsys):
    def ended(pythons, kinds, threads, rounds, blocks):
        raise RuntimeError(f"{pythons[1]} has ended")

    monkeypatch.setattr(against, "times", ended)
    assert main(["bench", "--guard", str(tmp_path / "python")]) == 2
    assert "which is no file; want the python of an environment" in capsys.readouterr().err
    assert main(["bench", "--guard", sys.executable]) == 2
    assert f"--guard cannot be used: {sys.executable} has ended" in capsys.readouterr().err
    assert main(["bench", "--guard", sys.executable, "--only", "rays"]) == 2
    assert "leave out --only" in capsys.readouterr().err
