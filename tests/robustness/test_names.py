"""Names are shown as they are, in pictures and in markdown, whatever they have in them."""

import json
import os
import re

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.evaluation.analysis.episodes import read_episodes
from lidarium.evaluation.drawing.picture_parts import save_figure
from lidarium.evaluation.report import write_report
from lidarium.evaluation.report.tables import code, plain
from lidarium.evaluation.suites.campaign import Campaign
from lidarium.evaluation.suites.suite import Suite
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.mapping.files.output import as_json

NAMES = ["$\\frac{$", "a|b`c", "<script>alert(1)<", "x\x1b[31m", "_*[a](b)_", "\udcff\udcfe", "$", "名"]


def levels():
    cells = np.full((40, 60), 255, np.uint8)
    cells[[0, -1]] = cells[:, [0, -1]] = 0
    return cells


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """A folder of episodes on floors, by policies and in variants of such names."""
    folder = tmp_path_factory.mktemp("names")
    floors = []
    for name in ("$\\frac{$", "a|b`c<script>", "\udcff"):
        write_ros_map(folder, "plain", levels(), (0.0, 0.0, 0.0), 0.1)
        (folder / f"{name}.yaml").write_bytes((folder / "plain.yaml").read_bytes())
        floors.append(str(folder / f"{name}.yaml"))
    suite = Suite(
        policies=("$x_{", "|`<b>"),
        floors=tuple(floors),
        variants={"$v_{|": {"horizon_s": 2.0, "lidar": {"beams": 60}}},
        policy_settings={"$x_{": {"policy": "random_walk"}, "|`<b>": {"policy": "nearest_frontier"}},
    )
    campaign = Campaign(suite, folder / "out", 1, True)
    for _ in campaign.run():
        pass
    assert not campaign.failures, campaign.failures
    return folder / "out"


def test_a_report_is_written_of_floors_policies_and_variants_of_any_name(evaluated, tmp_path):
    write_report(evaluated, tmp_path)
    page = (tmp_path / "report.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\]\(([^)]+\.png)\)", page)
    assert pictures
    assert all((tmp_path / picture).is_file() for picture in pictures)
    assert not re.search(r"(?<!\\)<(script|b)>", page)
    for line in page.splitlines():
        if line.startswith("|"):
            assert len(re.findall(r"(?<!\\)\|", line)) >= 3
    tables = re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE)
    for table in tables:
        widths = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(widths) == 1, table


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_with_any_words_is_drawn(name, tmp_path):
    figure = Figure()
    axes = figure.subplots()
    axes.set_title(name)
    axes.set_xticks([0, 1], [printable(name), "other"])
    figure.legend(axes.plot([0, 1], [0, 1]), [name])
    save_figure(tmp_path / "a.png", figure)
    assert cv2.imread(str(tmp_path / "a.png")) is not None


@pytest.mark.parametrize("name", NAMES)
def test_a_name_in_markdown_ends_neither_cell_nor_code(name):
    for shown in (plain(name), code(name)):
        assert not re.search(r"(?<!\\)\|", shown)
        shown.encode()
    inside = code(name)
    assert inside.startswith("`") == (not set("`|") & set(name))
    assert code("nearest_frontier") == "`nearest_frontier`"
    assert plain("2 robots, building:3") == "2 robots, building:3"


def test_names_that_cannot_be_printed_are_replaced_where_they_are_read(tmp_path, evaluated):
    write_ros_map(tmp_path, "plain", levels(), (0.0, 0.0, 0.0), 0.1)
    path = os.fsencode(tmp_path) + b"/\xff\xfe\x1b.yaml"
    with open(path, "wb") as file:
        file.write((tmp_path / "plain.yaml").read_bytes())
    assert load_floor(os.fsdecode(path)).name == "\ufffd\ufffd\ufffd"
    for row in read_episodes(evaluated).rows:
        row["floor"].encode()
    assert printable("名 a\t") == "名 a\ufffd"


def test_json_escapes_bytes_that_are_no_utf_8():
    text = as_json({"name": "a\udcff"})
    text.encode()
    assert json.loads(text) == {"name": "a\udcff"}
