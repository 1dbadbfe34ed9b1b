"""The page of settings holds the table of the settings as they are."""

from pathlib import Path

from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.table import markdown_table

PAGES = Path(__file__).parents[2] / "docs" / "reference"
PAGE = PAGES / "settings.md"
BEGIN, END = "<!-- settings: begin -->", "<!-- settings: end -->"


def test_the_page_holds_the_table_of_the_settings():
    text = PAGE.read_text(encoding="utf-8")
    table = text[text.index(BEGIN) + len(BEGIN) : text.index(END)].strip()
    assert table == markdown_table().strip(), (
        f"the table of {PAGE.name} is stale; `lidarium show settings --out FOLDER` writes settings.md, "
        f"which goes between the two comments"
    )


def test_the_page_of_the_camera_holds_the_table_of_its_settings():
    text = (PAGES / "depth_camera.md").read_text(encoding="utf-8")
    table = text.partition("<!-- camera: begin -->")[2].partition("<!-- camera: end -->")[0].strip()
    assert table == markdown_table(DepthCamera(), "camera.").strip(), (
        "the table of depth_camera.md is stale; markdown_table(DepthCamera(), 'camera.') makes it"
    )


def test_every_setting_has_a_text_of_its_own():
    for table in (markdown_table(), markdown_table(DepthCamera(), "camera.")):
        texts = [line.strip("| ").rsplit("|", 1)[-1].strip() for line in table.splitlines()]
        assert len(set(texts)) == len(texts)
