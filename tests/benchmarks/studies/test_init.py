"""The registry of studies, and the one command that runs them."""

import pytest

from lidarium.benchmarks.studies import STUDIES
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.scripts.main import main

NAMES = (
    *(
        "bounds",
        "dungeons",
        "fast",
        "floors",
        "interval_coverage",
        "leaderboard",
        "learned",
        "machines",
        "meetings",
        "merging",
    ),
    *("parity", "people", "prediction", "printed", "realism", "slam", "sparse", "splines", "srt", "supervisor"),
    "zoo",
)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_a_study_with_a_summary_of_one_line(name):
    assert isinstance(STUDIES[name], Study)
    assert len(STUDIES.summaries[name].splitlines()) == 1


def test_show_lists_all_of_them(capsys):
    assert main(["show", "studies"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert sorted(listed) == sorted(NAMES)


@pytest.mark.parametrize(("name", "near"), [("realizm", "realism"), ("machine", "machines")])
def test_an_unknown_name_is_answered_with_the_nearest(name, near, tmp_path, capsys):
    assert main(["reproduce", name, "--out", str(tmp_path)]) == 2
    assert f"did you mean {near!r}?" in capsys.readouterr().err
