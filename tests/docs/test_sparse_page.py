"""The page of sparse maps can be run as it stands, and shows what is printed."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "sparse_maps.md"


def test_code_prints_what_the_page_shows(capsys):
    names = {"__name__": PAGE.stem}
    blocks = re.findall(r"^```(python|text)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert [language for language, _ in blocks] == ["python", "text"] * 3
    for language, content in blocks:
        if language == "python":
            exec(compile(content, str(PAGE), "exec"), names)
        else:
            assert capsys.readouterr().out == content
