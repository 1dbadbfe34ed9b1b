"""Commands of a user's own: a function and its options in one file."""

import json
import sys
from importlib.metadata import EntryPoint

import pytest

from lidarium.registry import registry
from lidarium.scripts import commands
from lidarium.scripts.commands import COMMANDS, command
from lidarium.scripts.main import main

MODULE = '''
from dataclasses import dataclass

from lidarium.scripts.commands import command
from lidarium.scripts.common import Answer, Command


@dataclass(frozen=True, kw_only=True)
class Greet(Command):
    """Greet somebody."""

    name: str
    """who is greeted"""


@command("greet", "greet somebody")
def greet(options: Greet) -> Answer:
    if not options.name:
        raise ValueError("name is empty; want a name")
    return Answer({"greeting": f"hello {options.name}", "seed": options.seed}, f"hello {options.name}")
'''


@pytest.fixture
def my_command(tmp_path, monkeypatch):
    (tmp_path / "my_command.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LIDARIUM_IMPORT", "")
    path, before = list(sys.path), set(COMMANDS)
    yield "my_command"
    sys.path[:] = path
    sys.modules.pop("my_command", None)
    for name in set(COMMANDS) - before:
        COMMANDS.unregister(name)


@pytest.mark.parametrize(
    "words",
    [
        ["--import", "my_command", "greet"],
        ["greet", "--import=my_command"],
        ["greet", "--import", "my_command"],
    ],
)
def test_a_command_runs_with_its_options(my_command, capsys, words):
    assert main([*words, "--name", "you"]) == 0
    assert capsys.readouterr().out == "hello you\n"
    assert main([*words, "--name", "you", "--seed", "3", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"greeting": "hello you", "seed": 3}
    assert main([*words, "--name", ""]) == 2
    assert "want a name" in capsys.readouterr().err


def test_a_command_is_listed_with_its_options(my_command, capsys):
    assert main(["--import", my_command, "--help"]) == 0
    assert "greet somebody" in capsys.readouterr().out
    assert main(["--import", my_command, "greet", "--help"]) == 0
    assert "who is greeted" in capsys.readouterr().out


def test_an_installed_package_adds_commands(my_command, capsys, monkeypatch, tmp_path):
    entry = EntryPoint("welcome", "my_command:greet", "lidarium.commands")
    monkeypatch.setattr(commands, "entry_points", lambda group: [entry] if group == "lidarium.commands" else [])
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["welcome", "--name", "you"]) == 0
    assert capsys.readouterr().out == "hello you\n"
    assert "my_command" in COMMANDS.summaries["welcome"]


def test_modules_that_cannot_be_imported_are_refused(my_command, capsys):
    assert main(["--import", "my_comand", "greet"]) == 2
    assert "module 'my_comand' cannot be imported" in capsys.readouterr().err
    assert main(["greet", "--import"]) == 2
    assert "--import has no module" in capsys.readouterr().err


def test_built_in_commands_cost_nothing_until_they_are_used():
    assert registry("command") is COMMANDS
    assert "run" in COMMANDS
    assert COMMANDS.summaries["run"]
    with pytest.raises(ValueError, match="'run' is registered already"):
        command("run", "another")(print)
