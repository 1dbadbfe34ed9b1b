"""Code of reference pages on environments runs as it stands, and prints what is shown."""

import re
from pathlib import Path

import pytest

import lidarium

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"


@pytest.mark.parametrize(
    "name", ["conventions", "depth_camera", "environments", "floors", "observations", "policies", "learned", "station"]
)
def test_code_of_a_page_runs(name, capsys):
    text = (REFERENCE / f"{name}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(python|text)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    names = {"lidarium": lidarium}
    assert blocks
    for language, content in blocks:
        if language == "python":
            exec(compile(content, name, "exec"), names)
        else:
            assert capsys.readouterr().out == content
