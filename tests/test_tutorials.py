"""What the tutorials show can be run as it stands."""

import re
from pathlib import Path

import pytest
from films_read import read_film

from lidarium.agents.catalogue import POLICIES
from lidarium.scripts.commands import COMMANDS

TUTORIALS = Path(__file__).parents[1] / "docs" / "tutorials"


def code_of(name):
    """Return all Python of a tutorial, in one piece."""
    return "\n".join(re.findall(r"```python\n(.*?)```", (TUTORIALS / name).read_text(encoding="utf-8"), re.DOTALL))


def test_the_policy_of_the_tutorial_explores_the_apartment(capsys):
    try:
        exec(compile(code_of("add_a_policy.md"), "add_a_policy.md", "exec"), {})
    finally:
        POLICIES.unregister("keep_apart")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["keep_apart", "nearest_frontier"]
    assert all("0.99" in line for line in lines)


def test_the_floors_of_the_tutorial_can_be_explored(capsys):
    exec(compile(code_of("add_a_floor.md"), "add_a_floor.md", "exec"), {})
    coverage, building = capsys.readouterr().out.splitlines()
    assert 0.5 < float(coverage) < 1.0
    assert building.startswith("office")


def known_commands():
    """Return the names that `lidarium --help` lists."""
    return set(COMMANDS)


@pytest.mark.parametrize("name", sorted(path.name for path in TUTORIALS.glob("*.md")))
def test_commands_of_tutorials_exist(name):
    text = (TUTORIALS / name).read_text(encoding="utf-8")
    named = set(
        re.findall(r"lidarium (?!-)([a-z][a-z-]+)", " ".join(re.findall(r"```bash\n(.*?)```", text, re.DOTALL)))
    )
    assert named <= known_commands()


def test_the_furnished_apartment_is_mapped_as_the_tutorial_says(capsys):
    name = "map_a_furnished_apartment.md"
    exec(compile(code_of(name), name, "exec"), {})
    text = (TUTORIALS / name).read_text(encoding="utf-8")
    shown = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    assert capsys.readouterr().out == "".join(shown)


@pytest.mark.filterwarnings("ignore")  # of stable-baselines3, about rows that it reads only
def test_the_explorer_of_the_tutorial_is_trained_and_compared(capsys):
    pytest.importorskip("sb3_contrib", reason="sb3-contrib is not installed: extra [rl]")
    code = code_of("train_an_explorer.md").replace("set:train:64", "scene_room").replace("2_000", "100")
    exec(compile(code.replace('"validation:8"', '"validation:2"'), "train_an_explorer.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["untrained", "after a minute", "attentive"]
    assert all(0.0 < float(line.split(": ")[1].split()[0]) < 100.0 for line in lines)


def test_the_rewards_of_the_tutorial_have_the_terms_that_it_shows(capsys):
    exec(compile(code_of("shape_a_reward.md"), "shape_a_reward.md", "exec"), {})
    text = (TUTORIALS / "shape_a_reward.md").read_text(encoding="utf-8")
    assert capsys.readouterr().out == re.search(r"```text\n(.*?)```", text, re.DOTALL)[1]


def test_the_page_and_the_film_of_the_tutorial_are_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code_of("share_results.md"), "share_results.md", "exec"), {})
    assert "explore_lite on apartment, 2 robots, seed 0" in (tmp_path / "episode.html").read_text()
    assert 3.0 <= read_film(tmp_path / "episode.gif").seconds <= 6.0
