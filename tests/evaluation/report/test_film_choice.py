"""A film shows recorded episodes that can be compared: one of each policy."""

import json
import shutil

import pytest

from lidarium.evaluation.report.film_choice import Wanted, choose_episodes


@pytest.fixture
def folder(episodes_folder, tmp_path):
    """A copy, of the test's own."""
    return shutil.copytree(episodes_folder, tmp_path / "episodes")


def keep(folder, is_kept):
    path = folder / "episodes.jsonl"
    rows = [row for row in map(json.loads, path.read_text().splitlines()) if is_kept(row)]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_all_policies_of_the_first_seed_are_shown(folder):
    chosen = choose_episodes(folder, Wanted())
    assert chosen.title == "apartment, 2 robots, seed 0"
    assert list(chosen.records) == ["nearest_frontier", "random_walk", "utility_frontier"]
    assert all(path.name.endswith("-0.npz") for path in chosen.records.values())
    assert not chosen.left_out


def test_the_seed_with_the_most_policies_is_shown(folder):
    keep(folder, lambda row: row["seed"] == 1 or row["policy"] == "random_walk")
    assert choose_episodes(folder, Wanted()).title == "apartment, 2 robots, seed 1"
    assert list(choose_episodes(folder, Wanted(seed=0)).records) == ["random_walk"]


def test_policies_stand_as_they_are_asked_for(folder):
    wanted = Wanted("apartment", 2, 1, ("utility_frontier", "nearest_frontier"))
    assert list(choose_episodes(folder, wanted).records) == ["utility_frontier", "nearest_frontier"]


def test_policies_without_a_start_in_common_are_refused(folder):
    keep(folder, lambda row: (row["policy"] == "random_walk") == (row["seed"] == 1))
    with pytest.raises(ValueError, match="--film-policies has 'random_walk', which has no recorded episode from the"):
        choose_episodes(folder, Wanted(policies=("nearest_frontier", "random_walk")))


def test_there_is_room_for_nine(folder, monkeypatch):
    monkeypatch.setattr("lidarium.evaluation.report.film_choice.MOST_SIDE_BY_SIDE", 2)
    chosen = choose_episodes(folder, Wanted())
    assert list(chosen.records) == ["nearest_frontier", "random_walk"]
    assert chosen.left_out == ["utility_frontier"]


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (
            Wanted(floor="attic"),
            "--film-floor is 'attic', of which no episode is recorded; want one of",
        ),
        (Wanted(robots=3), "--film-robots is 3, of which no episode is recorded; want one of 2"),
        (Wanted(seed=7), "--film-seed is 7, of which no episode is recorded; want one of 0, 1"),
        (Wanted(policies=("best",)), "--film-policies is 'best'"),
    ],
)
def test_what_is_not_there_is_refused_with_what_is(folder, wanted, message):
    with pytest.raises(ValueError, match=message):
        choose_episodes(folder, wanted)


def test_a_folder_without_records_is_refused(folder):
    shutil.rmtree(folder / "records")
    with pytest.raises(ValueError, match=r"there are no records in .*records; want a folder"):
        choose_episodes(folder, Wanted())


def test_records_that_cannot_be_read_are_named(folder):
    for path in (folder / "records").iterdir():
        path.write_text("nothing of the kind")
    with pytest.raises(ValueError, match=r"can be filmed: The record .*npz was left out"):
        choose_episodes(folder, Wanted())
