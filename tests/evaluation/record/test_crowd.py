"""Records, frames and bags show people and doors; records without them have no arrays of theirs."""

import zipfile
from dataclasses import replace

import cv2
import numpy as np
import pytest
from page_reader import columns, unpacked

import lidarium
from lidarium.envs.drawing.frame_parts import DOOR, PERSON
from lidarium.evaluation.drawing.record_frames import TrackFrames, save_track_picture
from lidarium.evaluation.drawing.run_picture import save_run_picture
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.record.bag import write_bag
from lidarium.evaluation.record.file import read_record
from lidarium.evaluation.record.replay import is_same, rerun
from lidarium.evaluation.report.replay_page import replay_of
from lidarium.evaluation.viewing.moment import moment_of

SETTINGS = {"robots": 2, "horizon_s": 8.0, "resolution": 0.05}


@pytest.fixture(scope="module")
def among(tmp_path_factory):
    path = tmp_path_factory.mktemp("crowd") / "episode.npz"
    settings = lidarium.make_settings(people=4, doors=1.0, **SETTINGS)
    return lidarium.record("nearest_frontier", "office:1", settings, 3, path), path


def test_a_record_keeps_people_and_doors_and_runs_again_to_the_bit(among):
    record, path = among
    found = read_record(path)
    crowd = found.display.crowd
    assert crowd.people.shape == (41, 4, 3)
    assert crowd.opened.shape == (41, len(crowd.doors))
    for name in ("times", "people", "doors", "opened"):
        assert getattr(crowd, name) == pytest.approx(getattr(record.display.crowd, name), abs=1e-9)
    env = rerun(found)
    assert is_same(found, env)
    now = moment_of(env).crowd
    assert now.people == pytest.approx(crowd.people[-1], abs=1e-3)
    assert now.opened == pytest.approx(crowd.opened[-1], abs=1e-2)


def test_frames_of_records_and_of_environments_show_people_and_doors(among):
    record, _ = among
    settings = lidarium.make_settings(people=4, doors=1.0, **SETTINGS)
    env = lidarium.parallel_env("office:1", settings=settings, render_mode="rgb_array").unwrapped
    # The floor that is known at first is one of rooms with shut doors.
    env.reset(seed=3)
    for frame in (TrackFrames(record).draw(4.0), env.render()):
        for colour in (PERSON, DOOR):
            assert (frame == np.array(colour)).all(axis=2).sum() > 20


def count_of(path, colour):
    """Return how many pixels of a picture have a colour."""
    return int((cv2.imread(str(path))[..., ::-1] == np.array(colour)).all(axis=2).sum())


def test_static_pictures_show_people_and_doors(among, tmp_path):
    record, _ = among
    without = replace(record, display=replace(record.display, crowd=None))
    save_track_picture(tmp_path / "with.png", record)
    save_track_picture(tmp_path / "without.png", without)
    env = lidarium.parallel_env("office:1", settings=lidarium.make_settings(people=4, doors=1.0, **SETTINGS)).unwrapped
    save_run_picture(tmp_path / "run.png", run_episode(lidarium.policy("nearest_frontier"), env, 3), "nearest")
    for colour in (PERSON, DOOR):
        counts = {name: count_of(tmp_path / f"{name}.png", colour) for name in ("with", "without", "run")}
        # Beside discs and leaves only edges of letters have such a colour.
        assert counts["with"] > counts["without"] + 100
        assert counts["run"] > counts["without"] + 100


def test_a_replay_on_a_page_has_people_and_doors(among):
    record, _ = among
    crowd = record.display.crowd
    for each in (record, replace(record, header={**record.header, "version": "9.9.9"})):
        header, streams = unpacked(replay_of(each).text)
        assert header["people_radius_m"] == crowd.people[0, :, 2].tolist()
        assert header["doors"] == crowd.doors.tolist()
        assert columns(streams["crowd_times"], 1)[:, 0] == pytest.approx(crowd.times)
        people = columns(streams["people"], 8).reshape(-1, 4, 2)
        assert people == pytest.approx(crowd.people[..., :2], abs=1e-9)
        assert columns(streams["opened"], len(crowd.doors), 0.01) == pytest.approx(crowd.opened, abs=1e-9)


def test_a_record_without_people_has_no_arrays_of_people(tmp_path):
    path = tmp_path / "episode.npz"
    lidarium.record("nearest_frontier", "apartment", lidarium.make_settings(**SETTINGS), 3, path)
    assert not [name for name in zipfile.ZipFile(path).namelist() if "crowd" in name or "people" in name]
    assert read_record(path).display.crowd is None


def test_a_record_whose_people_do_not_fit_is_refused(among, tmp_path):
    _, path = among
    broken = tmp_path / "broken.npz"
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "people.npy":
                content = source.read("door_ends.npy")
            target.writestr(name, content)
    with pytest.raises(ValueError, match="people and doors"):
        read_record(broken)


def test_a_bag_has_a_frame_for_each_person_and_a_topic_for_each_door(among, tmp_path):
    mcap = pytest.importorskip("mcap.reader")
    record, _ = among
    path = tmp_path / "episode.mcap"
    write_bag(path, record)
    with path.open("rb") as file:
        messages = [(channel.topic, message.data) for _, channel, message in mcap.make_reader(file).iter_messages()]
    doors = range(len(record.display.crowd.doors))
    assert {f"/door_{number}" for number in doors} <= {topic for topic, _ in messages}
    for person in range(4):
        assert sum(topic == "/tf" and f"person_{person}".encode() in data for topic, data in messages) > 30
