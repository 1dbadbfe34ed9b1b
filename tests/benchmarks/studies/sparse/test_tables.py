"""Tables of the study hold what was measured, and the thesis's figures fit together."""

import math

import pytest
from published_pages import assert_published, keep

from lidarium.benchmarks.studies.sparse import drops, paths, quantisation, study
from lidarium.benchmarks.studies.sparse import thesis_figures as thesis
from lidarium.benchmarks.studies.sparse.figures import figure_table
from lidarium.benchmarks.studies.sparse.maps import THESIS, THESIS_FRAME_CODES
from lidarium.benchmarks.studies.sparse.pictures import draw_errors, draw_paths
from lidarium.benchmarks.studies.sparse.places import PLACES, TURNS, place_tasks
from lidarium.benchmarks.studies.sparse.quantisation import CODES
from lidarium.benchmarks.studies.sparse.tables import (
    error_table,
    failure_table,
    mean_table,
    measure_table,
    memory_table,
    node_table,
    thesis_failure_table,
)

PLANNERS = ("grid", "laser", "incremental", "full", "thesis incremental", "thesis full")


def line_of(place, missing=1, collide=0.0, seconds=5e-5):
    """Two answers of every planner, 4 m and 6 m long; the first planner leaves one request."""
    answers = {
        name: [
            [4.0, 3.0, seconds, 1.0, 0.5, 1.1, 0.6, 0.0],
            [6.0, 5.0, seconds, 2.0, 1.5, 2.1, 1.6, collide],
        ]
        for name in PLANNERS
    }
    if missing:
        answers["grid"][1] = None
    size = {"occupied": 500, "free": 400, "text": 30_000, "binary": 4000, "thesis_binary": 14_400}
    return {
        "place": place,
        "turns": TURNS,
        "requests": 2,
        "straight": [3.5, 5.5],
        "optimum": [4.0, 5.8],
        "answers": answers,
        "maps": dict.fromkeys(PLANNERS[2:], size),
        "graphs": {name: [300, 900] for name in PLANNERS[2:]},
        "tree": [60_000, 900_000, 10_000],
        "tops": {"laser": 0.9, "incremental": 1.0, "full": 1.0},
        "noisy": {
            "all": {"answered": 1, "collide": 0, "occupied": 900},
            "precise": {"answered": 2, "collide": 0, "occupied": 600},
        },
    }


@pytest.fixture
def lines():
    return [line_of(place) for place in PLACES]


def test_the_places_are_those_of_the_thesis():
    assert tuple(thesis.PLACES) == PLACES == tuple(THESIS)


@pytest.mark.parametrize("usage", thesis.USAGES)
def test_the_thesis_takes_16_bytes_a_node(usage):
    column = 3 if usage == "incremental" else 5
    for place in PLACES:
        nodes = sum(thesis.NODES[usage][place])
        assert 16 * nodes / 1000.0 == pytest.approx(thesis.KILOBYTES[place][column], abs=0.1)
    if usage == "full":
        assert all(sum(thesis.NODES[usage][place]) == THESIS[place].codes for place in PLACES)
    else:
        assert all(
            abs(sum(thesis.NODES[usage][place]) - THESIS_FRAME_CODES * THESIS[place].frames) < 32 for place in PLACES
        )


@pytest.mark.parametrize("usage", thesis.USAGES)
def test_requests_of_the_thesis_add_up(usage):
    for grid, sparse, both in thesis.FAILURES[usage]:
        assert both <= 1000 - max(grid, sparse)
        assert both >= 1000 - grid - sparse


def test_lengths_are_those_of_requests_that_both_answer(lines):
    shown = measure_table(lines)
    row = next(text for text in shown.splitlines() if text.startswith("| length [m], table 5.7 | apartment | full"))
    assert "4.000 ± 0.000 | 4.000 ± 0.000" in row
    assert "7.389 | 7.226" in row
    assert "| length [m], table 5.7 | apartment | 4.000 | 4.000 | 4.000 | 7.218 | 7.241 |" in mean_table(lines)


def test_failures_and_collisions_are_counted():
    shown = failure_table([line_of("apartment", collide=1.0)])
    assert "| apartment | 1, 0 | 0, 1 | 0, 1 | 0, 1 | 0, 1 | 0, 1 |" in shown
    assert "| apartment | full | 1 | 0 | 1 | 115, 89, 853 |" in thesis_failure_table([line_of("apartment")])


def test_memory_and_nodes_are_ratios_of_what_was_written(lines):
    assert "| 15.0 | 15.0 | 2.50 | 2.50 | 3.6, 3.6 |" in memory_table(lines)
    assert "| 400 | 500 | 300, 900 |" in node_table(lines)


def test_figures_are_judged_by_the_worst_place(lines):
    reached = figure_table(lines)
    assert "| requests answered, least of a place [%] | >= 99; 100 | 100.0 | 100.0 | yes |" in reached
    assert "| paths that collide, of all places | <= 0 | 0 | 0 | yes |" in reached
    lines[2] = line_of("home_arena", missing=0, collide=1.0)
    lines[2]["answers"]["full"][0] = None
    worse = figure_table(lines)
    assert "| requests answered, least of a place [%] | >= 99; 100 | 100.0 | 50.0 | yes, no |" in worse
    assert "| paths that collide, of all places | <= 0 | 1 | 1 | no, no |" in worse


@pytest.fixture
def clouds():
    figures = {
        "kmeans": [[codes, 1.0 / math.sqrt(codes), 1.0 / codes, 1e-3] for codes in CODES],
        "kmeans++": [[codes, 0.9 / math.sqrt(codes), 0.8 / codes, 2e-3] for codes in CODES],
        "lbg": [
            [codes, 0.95 / math.sqrt(codes), 0.9 / codes, 3e-3]
            for codes in CODES
            if codes in (16, 32, 64, 128, 256, 512)
        ],
    }
    return [{"kind": "kitchen", "name": str(k), "figures": figures} for k in range(2)]


def test_errors_are_means_over_clouds_and_curves_are_drawn(tmp_path, clouds):
    assert "| kitchen | 16 | 0.2500 | 0.2375 | 0.2250 | 0.900 | 1.0 | 3.0 | 2.0 |" in error_table(clouds)
    draw_errors(tmp_path / "errors.png", clouds)
    draw_paths(tmp_path / "paths.png", [line_of(place, 0) | {"straight": [3.5] * 2} for place in PLACES] * 10)
    assert all((tmp_path / f"{name}.png").stat().st_size > 10_000 for name in ("errors", "paths"))


def test_the_page_of_stored_figures_is_that_which_is_published(tmp_path, lines, clouds):
    keep(tmp_path / paths.PATHS_FILE, lines)
    keep(tmp_path / quantisation.QUANTISATION_FILE, clouds)
    counts = {"answered": 975, "over": 0}
    blind = {"answered": 1000, "over": 400}
    usages = {"incremental": counts, "incremental, all floor": blind, "full": counts, "full, all floor": blind}
    keep(tmp_path / drops.DROPS_FILE, [{"place": place, "requests": 1000, **usages} for place in PLACES])
    assert "| apartment | full | 97.5 | 0 | 400 |" in study.page(tmp_path)
    assert_published("sparse", study.page(tmp_path), tmp_path)


def test_a_part_of_the_study_takes_fewer_places_and_frames():
    assert [(task.name, task.turns) for task in place_tasks(1)] == [(place, TURNS) for place in PLACES]
    assert [(task.name, task.turns) for task in place_tasks(10)] == [(PLACES[0], TURNS // 2)]
