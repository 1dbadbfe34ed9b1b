"""The gallery has a page and a film of every environment, as its script makes them."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lidarium.evaluation.benchmark.tasks import benchmark

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("make_gallery", ROOT / "scripts" / "dev" / "make_gallery.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def listed(script):
    return list(script.entries(benchmark("lidarium-1")))


def test_all_environments_have_a_page_and_a_film_that_moves(script, listed):
    assert len(listed) == 4 + 12
    assert {path.stem for path in script.PAGES.glob("*.md")} == {entry.name for entry in listed} | {"index"}
    for entry in listed:
        with Image.open(script.PICTURES / f"{entry.name}.webp") as film:
            assert film.n_frames > 2, entry.name
            first = np.asarray(film.convert("L"), float)
            film.seek(film.n_frames - 1)
            last = np.asarray(film.convert("L"), float)
        assert first.std() > 5.0, entry.name
        assert np.abs(last - first).mean() > 1.0, entry.name


def test_all_floors_have_a_picture_that_is_not_blank(script):
    for name in script.FLOORS:
        with Image.open(script.PICTURES / f"{script._file(name)}.png") as picture:
            assert np.asarray(picture.convert("L")).std() > 10.0, name


@pytest.mark.parametrize("name", ["Exploration", "Dungeons-1", "Lab-3"])
def test_pages_are_as_the_script_makes_them(script, listed, name):
    (entry,) = (each for each in listed if each.name == name)
    assert (script.PAGES / f"{name}.md").read_text("utf-8") == script.page(entry, benchmark("lidarium-1"))


def test_the_gallery_shows_all(script, listed):
    assert (script.PAGES / "index.md").read_text("utf-8") == script.index(listed)
