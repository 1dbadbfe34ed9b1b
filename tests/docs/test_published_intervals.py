"""Published intervals are possible: ends apart, in order, finite, around the estimate."""

import csv
import json
import re
from pathlib import Path

import pytest

RESULTS = Path(__file__).parents[2] / "docs" / "results"
RANGES = ("srt", "growth")
"""Pages whose brackets are from the least to the greatest run."""

PAGES = [
    path
    for path in sorted((*RESULTS.glob("*.md"), *RESULTS.glob("*.csv"), RESULTS.parents[1] / "README.md"))
    if not path.name.startswith(RANGES)
]
NUMBER = r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?"
INTERVAL = re.compile(rf"({NUMBER})(?: ?%| s| m)? [(\[]({NUMBER})(?: to |, )({NUMBER})[)\]]")
MOST = 1e5
"""Beyond any time, path or ratio that is compared."""


def value(text):
    return float(text.replace(",", ""))


def intervals_of(cells):
    found = (INTERVAL.match(cell.strip().strip("*")) for cell in cells)
    return [tuple(map(value, each.groups())) for each in found if each]


def cells_of(page):
    with page.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file) if page.suffix == ".csv" else (line.split("|") for line in file)
        return [cell for row in rows for cell in row]


def test_impossible_intervals_are_found():
    cells = ["**-4 (-20098164285688004 to +20098164285687996)**", " +0 (+0 to +0)", "0.906 (0.884 to 0.929) ", "4"]
    assert [is_possible(*each) for each in intervals_of(cells)] == [False, False, True]


def is_possible(estimate, low, high):
    return low < high and low <= estimate <= high and max(abs(low), abs(high)) < MOST


@pytest.mark.parametrize("page", PAGES, ids=[path.name for path in PAGES])
def test_intervals_of_a_page_are_possible(page):
    found = intervals_of(cells_of(page))
    assert [each for each in found if not is_possible(*each)] == []


def test_intervals_of_the_leaderboards_page_are_possible():
    page = (RESULTS / "leaderboard.html").read_text(encoding="utf-8")
    content = json.loads(page.split('id="page-data">', 1)[1].split("</script>", 1)[0])
    for group in content["groups"]:
        for comparison in group["comparisons"]:
            found = comparison["difference"]
            if found is None or found["low"] is None:
                continue
            most = group["horizon_s"] if comparison["key"] in content["times"] else MOST
            assert -most <= found["low"] < found["high"] <= most, (group["title"], comparison)
