"""Examples come with lidarium and can be copied."""

import json
from pathlib import Path

import pytest

from lidarium.scripts.commands.examples import examples, summary
from lidarium.scripts.main import main

DOCS = Path(__file__).parents[3] / "docs"


def test_all_programs_configurations_and_notebooks_are_listed(capsys):
    assert main(["examples", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["examples"]
    wanted = [
        path.name
        for folder, ending in (("how_to/trainers", "*.py"), ("tutorials", "*.toml"), ("notebooks", "*.ipynb"))
        for path in (DOCS / folder).glob(ending)
    ]
    assert set(listed) == set(wanted)
    assert all(len(text) > 10 and "\n" not in text for text in listed.values())
    assert summary(examples()["first_run.ipynb"]) == "notebook: A first run"


def test_all_or_some_are_copied(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["examples", "copy", "ppo.py", "learned.toml", "--out", "some"]) == 0
    assert {path.name for path in Path("some").iterdir()} == {"ppo.py", "learned.toml"}
    assert Path("some/ppo.py").read_bytes() == examples()["ppo.py"].read_bytes()
    assert main(["examples", "copy"]) == 0
    assert {path.name for path in Path("examples").iterdir()} == set(examples())


def test_what_was_changed_is_never_replaced(tmp_path, capsys):
    out = ["--out", str(tmp_path)]
    assert main(["examples", "copy", "ppo.py", *out]) == 0
    assert main(["examples", "copy", "ppo.py", *out]) == 0
    (tmp_path / "ppo.py").write_text("mine")
    assert main(["examples", "copy", *out]) == 2
    assert "ppo.py is there and differs from the example" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["ppo.py"]
    assert (tmp_path / "ppo.py").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "guess"), [("pp.py", "did you mean ppo.py?"), ("zzz", "lidarium examples lists them")]
)
def test_an_unknown_name_is_told(tmp_path, capsys, name, guess):
    assert main(["examples", "copy", name, "--out", str(tmp_path)]) == 2
    assert guess in capsys.readouterr().err
