"""Pages of the documentation name what there is."""

import re
from pathlib import Path

import pytest
from films_read import read_film

from lidarium.envs.simulation.kernels.arrays import WorldArrays
from lidarium.evaluation.suites.suite import read_suite
from lidarium.registry import REGISTRIES
from lidarium.scripts.commands import COMMANDS
from lidarium.training.settings import read_training

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def text_of(name):
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("page", [page for page in PAGES if "```toml" in page.read_text(encoding="utf-8")])
def test_suites_of_the_pages_are_read(page, tmp_path):
    for number, block in enumerate(re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)):
        path = tmp_path / f"suite_{number}.toml"
        path.write_text(block, encoding="utf-8")
        if "[[rounds]]" in block:
            assert read_training(path).rounds
        else:
            assert next(iter(read_suite(path).trials()))


def test_the_architecture_names_all_arrays_of_the_kernels():
    page = text_of("docs/architecture.md")
    assert not [name for name in WorldArrays._fields if f"`{name}`" not in page]


def test_the_architecture_names_all_registries():
    page = text_of("docs/architecture.md")
    assert not [kind for kind in REGISTRIES if f"`{kind}`" not in page]


def test_the_architecture_can_be_read_in_five_minutes():
    assert text_of("docs/architecture.md").count("\n") <= 120
    assert text_of("README.md").count("\n") <= 90


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "decisions").glob("0*.md")), ids=lambda page: page.stem)
def test_a_decision_says_why_and_what_follows(page):
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"^## (\w+)$", text, re.MULTILINE) == ["Context", "Decision", "Consequences"]
    assert text.count("\n") <= 40


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page):
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", page.read_text(encoding="utf-8"))
    assert not [target for target in targets if not (page.parent / target).exists()]


FOLDERS = ("envs", "agents", "mapping", "evaluation", "training", "scripts", "benchmarks", "tests", "src")
FROM_ELSEWHERE = {"ParallelPettingZooEnv", "bt_navigator", "navigate_to_pose", "rmw_cyclonedds"}
"""Names of other projects."""

NO_NAMES = {"d_wall", "f_i", "intel_gfs", "floor_remark"}
"""Symbols of formulas, a log, and a key that is put together."""


@pytest.fixture(scope="module")
def words_of_sources():
    paths = [path for folder in FOLDERS for end in ("py", "json", "ts") for path in (ROOT / folder).rglob(f"*.{end}")]
    found = {word for path in paths for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))}
    return found | set(re.findall(r"\w+", text_of("pyproject.toml")))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_pages_name_files_and_names_that_exist(page, words_of_sources):
    text = page.read_text(encoding="utf-8")
    files = re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w./]*)`", text)
    # The links of an editable install are not part of the repository.
    assert not [name for name in files if not (ROOT / name).exists() and name != "src/lidarium/envs"]
    quoted = {word for name in re.findall(r"`([A-Za-z_.]+)(?:\(\))?`", text) for word in name.split(".")}
    names = {word for word in quoted if re.fullmatch(r"[A-Za-z]+_\w+|[A-Z][a-z]+[A-Z]\w+", word)}
    assert not names - words_of_sources - FROM_ELSEWHERE - NO_NAMES


def test_the_readme_names_commands_that_exist():
    known = set(COMMANDS)
    named = set(re.findall(r"`?lidarium (?!-)([a-z]+) ?(?:--|`|\w+ --|runs)", text_of("README.md")))
    assert named
    assert named <= known


def test_pictures_of_pages_load_soon():
    large = [path.name for path in (ROOT / "docs" / "images").iterdir() if path.stat().st_size > 3_000_000]
    assert not large


def test_the_animation_of_the_readme_is_that_of_a_run():
    (name,) = re.findall(r"\((docs/images/\w+\.gif)\)", text_of("README.md"))
    film = read_film(ROOT / name)
    options = dict(re.findall(r"--film-(\w+) (\d+)", text_of("README.md")))
    assert film.frames.shape[2] == int(options["width"])
    # A minute of simulated time, two joins that are held, and the end.
    assert 15.0 < film.seconds < 25.0


def test_a_release_has_few_and_short_entries():
    newest = text_of("CHANGELOG.md").split("\n## ")[1]
    entries = re.findall(r"^- (.*)$", newest, re.MULTILINE)
    assert 0 < len(entries) <= 40
    assert not [entry for entry in entries if len(entry.split()) > 60]
