"""Notebooks run, and objects show themselves there."""

import importlib.util
import io
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import lidarium
from lidarium.evaluation.suites.suite import suite_of
from lidarium.mapping.grids.occupancy import OccupancyGrid, OccupancySettings
from lidarium.notebooks import PICTURES, TABLES, show_pictures

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"


@pytest.fixture(scope="module")
def shell():
    """What IPython shows: by kind of content, functions of objects."""
    formatters = pytest.importorskip("IPython.core.formatters", reason="IPython is not installed: extra [docs]")
    display = formatters.DisplayFormatter()
    show_pictures(SimpleNamespace(display_formatter=display))
    return display


def picture_of(shell, item):
    """Return the picture (rows, columns, channels) that a notebook shows of an object."""
    content = shell.format(item)[0]["image/png"]
    return np.asarray(Image.open(io.BytesIO(content)))


def test_all_classes_exist():
    for name in (*PICTURES, *TABLES):
        module, _, of = name.rpartition(".")
        assert isinstance(getattr(__import__(module, fromlist=[of]), of), type)


def items():
    env = lidarium.parallel_env("apartment", robots=2, horizon_s=2.0)
    env.reset(seed=0)
    yield "environment", env
    batch = lidarium.vector_env(3, "apartment", horizon_s=2.0)
    batch.reset(seed=0)
    yield "batch", batch
    yield "batch in a wrapper", lidarium.gymnasium.wrappers.vector.RecordEpisodeStatistics(batch)
    if importlib.util.find_spec("stable_baselines3"):
        rows = lidarium.sb3_vec_env(2, "apartment", horizon_s=2.0)
        rows.reset()
        yield "batch of stable-baselines3", rows
    solo = lidarium.gymnasium.make("lidarium/Exploration-v1")
    solo.reset(seed=0)
    yield "Gymnasium environment", solo
    yield "Gymnasium environment without wrappers", solo.unwrapped
    turns = lidarium.env("apartment", robots=2, horizon_s=2.0)
    turns.reset(seed=0)
    yield "environment of turns", turns
    supervised = lidarium.Supervised(lidarium.parallel_env("apartment", robots=2, known_starts=False, horizon_s=2.0))
    supervised.reset(seed=0)
    yield "environment in a wrapper", supervised
    yield "floor", lidarium.load_floor("apartment")
    record = lidarium.record("nearest_frontier", settings=lidarium.make_settings(horizon_s=3.0))
    yield "record", record
    grid = OccupancyGrid(OccupancySettings())
    grid.contain(0.0, 0.0, 4.0, 3.0)
    grid.log_odds[5:20, 10:50] = 9
    yield "grid", grid
    inner = lidarium.ExplorationEnv("apartment", lidarium.make_settings(horizon_s=3.0))
    yield "episode", lidarium.run_episode(lidarium.policy("nearest_frontier"), inner, seed=0)


def test_pictures_show_what_there_is(shell):
    for name, item in items():
        picture = picture_of(shell, item)
        assert min(picture.shape[:2]) > 30, name
        assert picture.std() > 3.0, name


def test_maps_and_merged_maps_show_themselves(shell, tmp_path):
    levels = np.full((60, 90), 127, np.uint8)
    levels[5:50, 5:80] = 255
    levels[4], levels[:, 4], levels[30, 20:60] = 0, 0, 0
    lidarium.write_map(tmp_path, "room", levels, (0.0, 0.0, 0.0), 0.05)
    shown = picture_of(shell, lidarium.read_map(tmp_path / "room.yaml"))
    times = shown.shape[0] // 60
    assert (shown[times // 2 :: times, times // 2 :: times][::-1] == levels).all()
    merged = lidarium.merge_maps({"a": (levels, 0.05), "b": (levels, 0.05)})
    assert picture_of(shell, merged).std() > 3.0


def test_environments_before_their_reset_and_of_others_are_text(shell):
    others = lidarium.gymnasium.make("CartPole-v1"), lidarium.gymnasium.make_vec("CartPole-v1", num_envs=2)
    for env in (lidarium.parallel_env("apartment"), lidarium.vector_env(2, "apartment"), *others):
        assert "image/png" not in shell.format(env)[0]


def test_suites_and_rows_are_tables(shell):
    settings = {"policies": ["srt", "<b>"], "policy_settings": {"<b>": {"policy": "srt"}}}
    suite = suite_of({**settings, "floors": [f"building:{k}" for k in range(20)], "seeds": 2})
    shown = shell.format(suite)[0]["text/html"]
    assert "20 in all" in shown
    assert "&lt;b&gt;" in shown
    assert re.search(r"episodes</th><td>80<", shown)
    rows = lidarium.evaluate(
        ["nearest_frontier", "random_walk"], robots=1, seeds=1, settings={"horizon_s": 3.0}, progress=False
    )
    shown = shell.format(rows)[0]["text/html"]
    assert shown.count("<tr>") == 3
    assert "<td>not</td>" in shown
    assert rows[0]["policy"] == "nearest_frontier"


def test_a_bar_shows_progress_if_it_is_asked_for(capsys):
    lidarium.evaluate("random_walk", seeds=1, settings={"horizon_s": 1.0}, progress=True)
    assert "1/1" in capsys.readouterr().err


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: extra [docs]")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed: extra [docs]")
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are made when the page is built"
    client = nbclient.NotebookClient(
        notebook, timeout=None, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    shown = {kind for output in outputs for kind in output.get("data", {})}
    assert shown & {"image/png", "text/html"}
    # A cell can be run again.
    assert not [output for output in outputs if output.output_type == "error"]
