import json

import pytest

from lidarium.evaluation.report import read_episodes


def changed(row, **changes):
    return {**row, **changes}


def test_episodes_are_read_in_the_order_of_the_file(episodes_folder, rows):
    episodes = read_episodes(episodes_folder)
    assert list(episodes.rows) == rows
    assert episodes.version == rows[0]["version"]
    assert episodes.warnings == ()


@pytest.mark.parametrize("bytes_left", [1, 40, 300])
def test_a_last_line_that_breaks_off_is_dropped_with_a_warning(rows, directory_of, bytes_left):
    folder = directory_of(rows[:2], tail=json.dumps(rows[2])[:bytes_left])
    episodes = read_episodes(folder)
    assert list(episodes.rows) == rows[:2]
    assert episodes.warnings == (
        f"Line 3 of episodes.jsonl breaks off ({bytes_left} bytes) and was left out: its episode was not finished.",
    )


def test_a_letter_cut_in_two_is_no_more_than_a_line_that_breaks_off(rows, directory_of):
    folder = directory_of(rows[:1])
    with (folder / "episodes.jsonl").open("ab") as file:
        file.write('{"floor": "Büro'.encode()[:-3])
    assert len(read_episodes(folder).rows) == 1


def test_a_whole_last_line_without_a_line_feed_counts(rows, directory_of):
    assert len(read_episodes(directory_of(rows[:1], tail=json.dumps(rows[1]))).rows) == 2


def test_an_episode_that_is_there_twice_is_counted_once_and_told(rows, directory_of):
    episodes = read_episodes(directory_of([rows[0], rows[1], changed(rows[0], steps_per_s=1.0)]))
    assert list(episodes.rows) == rows[:2]
    assert (
        "Lines 1 and 3 of episodes.jsonl are the same episode (nearest_frontier on apartment, 2 robots, seed "
        "0)" in episodes.warnings[0]
    )


def test_an_episode_under_two_names_of_a_floor_or_with_a_record_is_counted_once(rows, directory_of):
    again = changed(rows[0], key="the same floor by another name", record=None)
    assert len(read_episodes(directory_of([rows[0], again])).rows) == 1


def test_episodes_that_failed_are_told(rows, directory_of):
    folder = directory_of(rows)
    (folder / "failed.json").write_text(json.dumps({"default | clinic": "ValueError: no"}))
    assert read_episodes(folder).warnings == (
        "Failed episodes, which are missing here: 1, first default | clinic: ValueError: no.",
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"coverage_final": 0.5},
            r"lines 1 and 3 tell of the same episode \(nearest_frontier .*\) but differ in coverage_final",
        ),
        ({"version": "0.0.9", "seed": 7}, r"two versions: .* in line 1 and 0\.0\.9 in line 3"),
        (
            {"settings_sha256": "ab" * 32, "horizon_s": 90.0, "seed": 7},
            "two settings with 2 robots, in lines 1 and 3: horizon_s 40.0 and 90.0",
        ),
        (
            {"settings_sha256": "ab" * 32, "seed": 7},
            r"two settings .*: settings_sha256 [0-9a-f]{12}\.\.\. and abababababab",
        ),
        ({"path_m": 3.0}, "line 3 has path_m 3.0"),
        ({"robots": True}, "line 3 has robots True"),
        ({"t99_s": -1.0}, "line 3 has t99_s -1.0; want seconds or null"),
        ({"bound_s": "soon"}, "line 3 has bound_s 'soon'; want seconds or null"),
    ],
)
def test_what_does_not_belong_together_is_refused_and_named(rows, directory_of, change, message):
    with pytest.raises(ValueError, match=message):
        read_episodes(directory_of([rows[0], rows[1], changed(rows[0], **change)]))


def test_floors_of_one_name_are_told_apart(rows, directory_of):
    other = changed(rows[0], floor_sha256="ab" * 32, seed=7)
    floors = [row["floor"] for row in read_episodes(directory_of([*rows, other])).rows]
    assert floors == [f"apartment ({rows[0]['floor_sha256'][:6]})"] * len(rows) + ["apartment (ababab)"]


def test_episodes_of_two_setups_of_a_policy_are_refused(rows, directory_of):
    first, other = (changed(rows[0], seed=seed, setup_sha256=letter) for seed, letter in enumerate("ab"))
    with pytest.raises(ValueError, match="of nearest_frontier with two options of the policy, rules to stop"):
        read_episodes(directory_of([first, other]))
    read_episodes(directory_of([first, changed(other, policy="mine")]))


def test_other_settings_with_other_numbers_of_robots_are_fine(rows, directory_of):
    episodes = read_episodes(directory_of([rows[0], changed(rows[0], robots=3, settings_sha256="ab" * 32)]))
    assert len(episodes.rows) == 2


def test_a_line_that_is_no_episode_is_refused(rows, directory_of):
    folder = directory_of(rows[:1])
    path = folder / "episodes.jsonl"
    path.write_text('{"floor": \n' + path.read_text())
    with pytest.raises(ValueError, match="line 1 is not JSON"):
        read_episodes(folder)
    path.write_text("[1, 2]\n")
    with pytest.raises(ValueError, match="line 1 is not a JSON object"):
        read_episodes(folder)
    path.write_text(json.dumps({key: value for key, value in rows[0].items() if key != "overlap"}) + "\n")
    with pytest.raises(ValueError, match="line 1 has no key 'overlap'"):
        read_episodes(folder)


def test_a_folder_without_episodes_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no episodes\.jsonl in"):
        read_episodes(tmp_path)
    (tmp_path / "episodes.jsonl").write_text('{"flo')
    with pytest.raises(ValueError, match="has no finished episode"):
        read_episodes(tmp_path)
