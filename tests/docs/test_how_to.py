"""How-to pages can be run as they stand, and show what is printed."""

import re
from pathlib import Path

import pytest

from lidarium.registry import REGISTRIES, registry

PAGES = sorted((Path(__file__).parents[2] / "docs" / "how_to").glob("add_*.md"))
PEOPLE = Path(__file__).parents[2] / "docs" / "how_to" / "people_and_doors.md"
MOST_PLACES = {"add_a_sensor": 3}


@pytest.fixture
def clean_registries():
    """Take away what a page registers."""
    before = {kind: set(registry(kind)) for kind in REGISTRIES}
    yield
    for kind, names in before.items():
        for name in set(registry(kind)) - names:
            registry(kind).unregister(name)


def blocks_of(page):
    """Yield language and content of each block of Python and of output."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"^```(python|text)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [*PAGES, PEOPLE], ids=lambda page: page.stem)
def test_code_prints_what_the_page_shows(page, clean_registries, capsys):
    names = {"__name__": page.stem}
    shown = 0
    for language, content in blocks_of(page):
        if language == "python":
            exec(compile(content, str(page), "exec"), names)
        else:
            assert capsys.readouterr().out == content
            shown += 1
    assert shown
    assert not capsys.readouterr().out


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_says_at_its_top_how_many_places_are_touched(page):
    top = page.read_text(encoding="utf-8").splitlines()[:3]
    said = re.search(r"\*\*Places touched: (\d)\*\*|\*\*Places touched: (\d)\.\*\*", "\n".join(top))
    assert said
    assert int(said[1] or said[2]) <= MOST_PLACES.get(page.stem, 1)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_links_to_the_reference(page):
    assert re.search(r"\]\(\.\./reference/\w+\.md", page.read_text(encoding="utf-8"))
