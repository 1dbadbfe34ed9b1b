"""The how-to of models in evaluations runs as it stands."""

import re
import shlex
from pathlib import Path

import pytest

from lidarium.scripts.main import main

pytest.importorskip("sb3_contrib", reason="sb3-contrib is not installed: extra [rl]")
PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "evaluate_a_model.md"


def test_a_trained_model_comes_to_the_page_beside_a_reference_policy(tmp_path, monkeypatch, capsys):
    training, policy = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    (commands,) = re.findall(r"^```bash\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    exec(compile(training, str(PAGE), "exec"), {"__name__": "training"})
    (tmp_path / "my_model.py").write_text(policy)
    assert len(policy.splitlines()) <= 30
    for command in commands.strip().splitlines():
        assert main([*shlex.split(command)[1:], *(["--workers", "1"] if "evaluate" in command else [])]) == 0
    page = (tmp_path / "runs" / "mine" / "report" / "report.md").read_text("utf-8")
    assert "my_model:MyModel" in page
    assert "nearest_frontier" in page
    # What it was made of is part of the results.
    (tmp_path / "my_model.py").write_text(policy + "\n# changed\n")
    capsys.readouterr()
    assert main([*shlex.split(commands.strip().splitlines()[0])[1:], "--seeds", "2"]) == 2
    assert "as it was before its file changed" in capsys.readouterr().err
