"""The structure of results pages: what a study writes today beside what is published."""

import csv
import json
import re
from pathlib import Path

from lidarium.benchmarks.results_page import about, publish

PUBLISHED = Path(__file__).parents[1] / "docs" / "results"


def keep(path, lines):
    """Store lines as a study keeps those that were asked for."""
    keyed = [{"key": str(number), **line} for number, line in enumerate(lines)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(line) + "\n" for line in keyed))
    path.with_name(f"{path.stem}_asked.json").write_text(json.dumps({"keys": [line["key"] for line in keyed]}))


def sections(page):
    """The tables of each section of a page: the name of the file, if it is in one, and the columns."""
    text = page.read_text().partition("\n## Notes\n")[0]
    found = {}
    for part in re.split(r"^(?=#+ )", text, flags=re.MULTILINE):
        heading, _, body = part.partition("\n")
        tables = []
        for link, table in re.findall(r"\[([\w.]+\.csv)\]\(\1\)|((?:^\|.*\n?)+)", body, re.MULTILINE):
            rows = csv.reader((page.parent / link).read_text().splitlines()) if link else None
            columns = next(rows) if rows else [cell.strip() for cell in table.splitlines()[0].strip("|").split("|")]
            tables.append((link, columns))
        found[re.sub(r" \(\d+\)$", "", heading)] = tables
    return {heading: tables for heading, tables in found.items() if heading}


def assert_published(study, text, folder, absent=()):
    """Assert that a page from small inputs has the sections, tables, columns and files of the published one.

    ``absent`` are beginnings of headings of which small inputs have nothing; columns may be more.
    """
    folder = folder / "page"
    folder.mkdir()
    publish(folder / f"{study}.md", text, about(f"lidarium reproduce {study}"))
    ours, theirs = sections(folder / f"{study}.md"), sections(PUBLISHED / f"{study}.md")
    theirs = {heading: tables for heading, tables in theirs.items() if not heading.lstrip("# ").startswith(absent)}
    ours = {heading: tables for heading, tables in ours.items() if not heading.lstrip("# ").startswith(absent)}
    assert list(ours) == list(theirs)
    for heading, tables in theirs.items():
        assert [link for link, _ in ours[heading]] == [link for link, _ in tables], heading
        for (_, columns), (_, published) in zip(ours[heading], tables, strict=True):
            more = iter(columns)
            assert all(column in more for column in published), (heading, columns, published)
