"""The page of settings holds the table of the settings as they are."""

from pathlib import Path

from lidarium.envs.settings.table import markdown_table

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "settings.md"
BEGIN, END = "<!-- settings: begin -->", "<!-- settings: end -->"


def test_the_page_holds_the_table_of_the_settings():
    text = PAGE.read_text(encoding="utf-8")
    table = text[text.index(BEGIN) + len(BEGIN) : text.index(END)].strip()
    assert table == markdown_table().strip(), (
        f"the table of {PAGE.name} is stale; `lidarium show settings --out FOLDER` writes settings.md, "
        f"which goes between the two comments"
    )
