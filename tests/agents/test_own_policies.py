"""Policies of one's own by module and class, in Python and on the command line."""

import json

import pytest

import lidarium
from lidarium.agents.random_walk import RandomWalk
from lidarium.scripts.main import main

OWN = """
from lidarium.agents.random_walk import RandomWalk


class Walker(RandomWalk):
    pass


def number():
    return 3
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "own_walkers.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_a_class_of_a_module_is_made_with_its_settings():
    assert type(lidarium.policy("lidarium.agents.random_walk:RandomWalk")) is RandomWalk


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("no_such_module:Walker", "module 'no_such_module' cannot be imported"),
        (":Walker", "module '' cannot be imported"),
        ("own_walkers:Walkr", "unknown class of own_walkers 'Walkr'; did you mean 'Walker'"),
        ("own_walkers:", "unknown class of own_walkers ''"),
        ("own_walkers:number", "want a subclass of lidarium.Policy"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_what_is_no_policy_is_refused_by_name(name, words):
    with pytest.raises(ValueError, match=words):
        lidarium.policy(name)


def test_both_commands_take_policies_of_the_folder(folder, capsys):
    team = ["--robots", "1", "--horizon-s", "2", "--map-resolution", "0.05", "--json"]
    assert main(["run", "--policy", "own_walkers:Walker", "--floor", "scene_room", *team]) == 0
    assert json.loads(capsys.readouterr().out)["policy"] == "own_walkers:Walker"
    own = ["--policies", "own_walkers:Walker", "--floors", "scene_room", "--seeds", "1", "--workers", "1"]
    code = main(["evaluate", *own, "--out", str(folder / "runs"), *team])
    assert code == 0
    assert json.loads(capsys.readouterr().out)["finished"] == 1
