"""Results pages: conclusion and notes stay, long tables go to files, and stale words are named."""

import pytest
from published_pages import PUBLISHED

from lidarium.benchmarks.results_page import about, in_file, publish
from lidarium.benchmarks.studies import STUDIES

TABLE = "| floor | `time` [s] |\n|---|---:|\n| a \\| b | **{}** |"
PAGE = "# Runs\n\nAll of them.\n\n## Times (3)\n\nIn seconds.\n\n" + in_file(TABLE) + "\n\nThat is all.\n"


def told(day="2026-01-01"):
    return {**about("lidarium reproduce runs"), "date": day}


@pytest.fixture
def page(tmp_path):
    publish(tmp_path / "runs.md", PAGE.format(7), told())
    return tmp_path / "runs.md"


def test_a_first_page_asks_for_a_conclusion(tmp_path):
    words = publish(tmp_path / "runs.md", PAGE.format(7), told(), "A part ran.")
    assert "its conclusion has to be written" in words
    title, made, about_all, *_ = (tmp_path / "runs.md").read_text().split("\n\n")
    assert title == "# Runs"
    assert made.startswith("Made by `lidarium reproduce runs` on 2026-01-01: ")
    assert made.endswith(". A part ran.")
    assert about_all == "All of them."


def test_marked_tables_are_files_named_by_their_section(page):
    assert "\n\nIn seconds.\n\nTable (1 rows): [runs_times.csv](runs_times.csv).\n\nThat is all." in page.read_text()
    assert page.with_name("runs_times.csv").read_text() == "floor,time [s]\na | b,7\n"
    assert "|" not in page.read_text()


def test_several_tables_of_a_section_are_counted(tmp_path):
    publish(tmp_path / "runs.md", "# Runs\n\n" + "\n\n".join([in_file(TABLE)] * 3), told())
    assert sorted(path.stem for path in tmp_path.glob("*.csv")) == ["runs_runs", "runs_runs_2", "runs_runs_3"]


def concluded(page):
    text = page.read_text().replace("\nMade by", "\nIt takes 7 s.\n\nNobody waits.\n\nMade by")
    page.write_text(text + "\n## Notes\n\nThe machine was busy.\n\n### Before\n\n| a |\n|---|\n| b |\n")


def test_conclusion_and_notes_stay_while_figures_stay(page):
    concluded(page)
    before = page.read_text()
    assert publish(page, PAGE.format(7), told("2026-02-02")) == f"{page} is written"
    assert page.read_text() == before.replace("2026-01-01", "2026-02-02")


@pytest.mark.parametrize("text", [PAGE.format(8), PAGE.format(7).replace("All", "Some")])
def test_of_other_figures_the_page_says_for_which_it_was_concluded(page, text):
    concluded(page)
    assert "figures have changed" in publish(page, text, told("2026-02-02"))
    stale = "*Conclusion and notes were written for the figures of 2026-01-01.*"
    found = page.read_text()
    assert f"\n\nIt takes 7 s.\n\nNobody waits.\n\n{stale}\n\nMade by" in found
    assert found.endswith("## Notes\n\nThe machine was busy.\n\n### Before\n\n| a |\n|---|\n| b |\n")
    publish(page, PAGE.format(9), told("2026-03-03"))
    assert page.read_text().count("written for the figures of") == 1
    assert stale in page.read_text()


def test_files_of_tables_that_are_no_more_are_deleted(page):
    publish(page, "# Runs\n\nNothing.", told())
    assert not page.with_name("runs_times.csv").exists()


@pytest.mark.parametrize("name", [*STUDIES, "speed", "growth", "profile"])
def test_published_pages_open_with_a_conclusion_of_five_lines_at_most(name):
    title, conclusion, made, *_ = (PUBLISHED / f"{name}.md").read_text().split("\n\n")
    assert title.startswith("# ")
    assert 1 <= len(conclusion.splitlines()) <= 5
    assert made.startswith("Made by `")


@pytest.mark.parametrize("page", sorted(PUBLISHED.glob("*.md")), ids=lambda page: page.stem)
def test_results_pages_open_with_sentences_not_tables(page):
    title, conclusion, *_ = page.read_text(encoding="utf-8").split("\n\n")
    assert title.startswith("# ")
    assert len(conclusion.splitlines()) <= 5
    assert not conclusion.startswith(("|", "!", "Made by"))
