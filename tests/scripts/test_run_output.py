"""What a run leaves: files, maps of the team, films, summary."""

import json

import cv2
import pytest
from short_runs import short_run

import lidarium
from lidarium.agents.srt.tree_files import read_tree
from lidarium.envs.faces.merged_maps import true_frames
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing.films import FilmSettings, ScanFrames, frames_of
from lidarium.evaluation.drawing.map_film import MapFrames
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, read_record
from lidarium.mapping.files.map_files import read_ros_map
from lidarium.mapping.files.spline_files import read_spline_map
from lidarium.scripts.run_output import RunFilms, _of_station, write_run, write_team


@pytest.mark.parametrize("is_recorded", [False, True])
def test_all_files_that_are_named_are_there_and_no_others(tmp_path, is_recorded):
    recorder = Recorder("nearest_frontier", 0, "apartment") if is_recorded else None
    episode = short_run(watchers=[recorder] if is_recorded else [])
    files = write_run(tmp_path, episode, {"a": 1}, recorder, "nearest_frontier", [])
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir())
    assert ("episode.npz" in files) == is_recorded
    assert json.loads((tmp_path / "result.json").read_text()) == {"a": 1}
    assert cv2.imread(str(tmp_path / "run.png")) is not None
    if is_recorded:
        assert read_record(tmp_path / "episode.npz").header["policy"] == "nearest_frontier"


def test_a_film_that_is_not_there_is_missed(tmp_path):
    with pytest.raises(OSError, match=r"run\.mp4"):
        write_run(tmp_path, short_run(), {}, None, "nearest_frontier", ["run.mp4"])


def test_a_lone_robot_leaves_its_map_and_no_frames(tmp_path):
    assert write_team(tmp_path, short_run(robots=1)) == ["robot_0.yaml", "robot_0.pgm"]
    assert (read_ros_map(tmp_path / "robot_0.yaml").levels == 255).sum() > 1000


def test_robots_that_know_their_starts_lie_as_they_started(tmp_path):
    episode = short_run()
    files = write_team(tmp_path, episode)
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir())
    maps = json.loads((tmp_path / "transforms.json").read_text())["maps"]
    true = true_frames(episode.env)["robot_0", "robot_1"]
    found = maps["robot_1"]
    assert (found["x"], found["y"], found["theta"]) == pytest.approx((true.x, true.y, true.theta), abs=1e-6)
    assert found["group"] == maps["robot_0"]["group"] == 0


def test_robots_that_nobody_joins_lie_nowhere(tmp_path):
    write_team(tmp_path, short_run("nearest_frontier_own_map", known_starts=False))
    known = json.loads((tmp_path / "transforms.json").read_text())
    assert known["maps"] == {"robot_0": None, "robot_1": None}
    assert known["pairs"] == []


@pytest.mark.parametrize(
    ("shown", "options", "kind"),
    [
        ("auto", {"known_starts": True}, ScanFrames),
        ("auto", {"known_starts": False}, MapFrames),
        ("auto", {"known_starts": False, "robots": 1}, ScanFrames),
        ("auto", {"known_starts": False, "camera": "xtion"}, ScanFrames),
        ("maps", {"known_starts": False, "camera": "xtion"}, MapFrames),
        ("maps", {"known_starts": False, "robots": 1}, MapFrames),
        ("scans", {"known_starts": False}, ScanFrames),
    ],
)
def test_maps_are_shown_where_there_are_several(shown, options, kind):
    env = WatchedExploration("open_apartment", make_settings(**{"robots": 2, **options}))
    films = RunFilms(env, lidarium.policy("nearest_frontier"), ["run.gif"], shown, FilmSettings())
    assert isinstance(frames_of(films._shown, lidarium.policy("nearest_frontier"), 640), kind)


def test_a_run_without_films_writes_nothing(tmp_path):
    env = WatchedExploration("apartment", make_settings(robots=2))
    films = RunFilms(env, lidarium.policy("nearest_frontier"), [], "maps", FilmSettings())
    with films.kept():
        films.begin(tmp_path)
        films.end()
    assert films.seconds == 0.0
    assert not env.watchers
    assert not list(tmp_path.iterdir())


KNOWN = {
    "decisions": 9,
    "redirections": 3,
    "stops": 2,
    "pauses": 0,
    "resumes": 0,
    "by_rule": {"0": 4, "3": 5},
    "joined": 1,
    "dropped": 0,
}


def orders(**more):
    return dict(_of_station({"supervisor": KNOWN | more, "merges": {"wrong": 0}}))["orders"]


def test_pauses_are_named_where_there_were_any():
    assert orders() == "3 redirections and 2 stops of 9 decisions; 5 by rule 3"
    assert orders(pauses=2, resumes=1).startswith("3 redirections, 2 pauses, 1 resumes and 2 stops of 9 ")


def test_without_a_station_nothing_is_said():
    assert _of_station({"supervisor": None, "merges": None}) == []


@pytest.mark.parametrize("known_starts", [True, False])
def test_spline_maps_and_trees_are_left_to_be_read_and_begun_with(tmp_path, known_starts):
    settings = {"localization": "splines", "known_starts": known_starts}
    env = WatchedExploration("apartment", make_settings(robots=1, horizon_s=10.0, **settings))
    episode = lidarium.run_episode(lidarium.policy("srt", memory="regions"), env, seed=0)
    files = write_run(tmp_path, episode, {}, None, "srt", [])
    assert sorted(files) == sorted(path.name for path in tmp_path.iterdir())
    assert set(files) > {"robot_0_splines.npz", "robot_0_splines.png", "tree.npz", "tree.png"}
    found, made = read_spline_map(tmp_path / "robot_0_splines.npz"), env.perception.poses.localizers[0].map
    assert len(found.curves) == len(made.curves) > 3
    assert found.length == pytest.approx(made.length, rel=0.01)
    assert len(read_tree(tmp_path / "tree.npz").nodes) == len(episode.policy.tree.nodes)
    begun = make_settings(
        robots=1,
        horizon_s=2.0,
        assigned=[f"localizer.tracking.start_map={tmp_path / 'robot_0_splines.npz'}"],
        **settings,
    )
    again = WatchedExploration("apartment", begun)
    lidarium.run_episode(lidarium.policy("srt", memory="regions", tree=tmp_path / "tree.npz"), again, seed=0)
    assert again.perception.poses.localizers[0].map.length == pytest.approx(found.length, rel=0.15)
