"""Pictures of what a record shows, without its floor or version."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from lidarium.envs.drawing.frame_parts import EXPLORED, UNEXPLORED, team_colours
from lidarium.evaluation.drawing.record_frames import TrackFrames, save_track_picture


@pytest.fixture
def foreign(apartment_record):
    """A record of a version that is not known, on a floor that is not there."""
    header = {
        **apartment_record.header,
        "version": "0.0.7",
        "floor": "attic",
        "floor_source": None,
        "settings": {},
    }
    return replace(apartment_record, header=header)


def share_of(frame, colour):
    return float((frame == np.array(colour)).all(axis=2).mean())


def test_frames_show_the_map_as_it_grows_and_the_robots(foreign):
    frames = TrackFrames(foreign, 320)
    first, last = frames.draw(0.0), frames.draw(60.0)
    assert first.shape == last.shape
    assert first.shape[0] % 2 == first.shape[1] % 2 == 0
    assert share_of(first, EXPLORED) < share_of(last, EXPLORED)
    assert share_of(first, UNEXPLORED) > share_of(last, UNEXPLORED)


def test_a_frame_is_the_same_whatever_was_drawn_before(foreign):
    frames = TrackFrames(foreign, 320)
    times = [3.0, 3.5, 30.0, 4.1, 0.0, 1000.0]
    for time_s in times:
        assert (frames.draw(time_s) == TrackFrames(foreign, 320).draw(time_s)).all()


def test_a_robot_is_drawn_in_its_colour_where_it_is(foreign):
    frames = TrackFrames(foreign, 640)
    frame, view = frames.draw(30.0), frames.view
    x, y = foreign.display.poses_at(30.0)[1, :2]
    column, row = (
        int((x - view.origin[0]) * view.scale) + 10,
        frame.shape[0] - 10 - int((y - view.origin[1]) * view.scale),
    )
    around = frame[row - 12 : row + 12, column - 12 : column + 12]
    assert share_of(around, team_colours(2)[1]) > 0.3


def test_a_picture_shows_the_end(foreign, tmp_path):
    save_track_picture(tmp_path / "track.png", foreign)
    picture = cv2.imread(str(tmp_path / "track.png"))[..., ::-1]
    assert picture.shape[1] > 1000
    assert 0.3 < share_of(picture, (255, 255, 255)) < 0.95
    assert all(share_of(picture, colour) > 3e-4 for colour in team_colours(3))


def test_what_is_unknown_is_tinted_if_robots_predicted_or_one_asks(foreign, tmp_path):
    predicting = replace(foreign, header={**foreign.header, "predicts": True})
    plain, tinted = TrackFrames(foreign, 320).draw(2.0), TrackFrames(predicting, 320).draw(2.0)
    differs = (plain != tinted).any(axis=2)
    assert differs.mean() > 0.05
    assert (tinted[differs][:, 2] >= plain[differs][:, 2]).mean() > 0.99
    assert (tinted[differs][:, 0] < plain[differs][:, 0]).all()
    assert not (plain[differs] == EXPLORED).all(axis=1).any()
    assert (TrackFrames(foreign, 320, predicts=True).draw(2.0) == tinted).all()
    changes = foreign.display.changes
    early = replace(changes, counts=changes.counts * (changes.times <= 2.0))
    short = replace(foreign, display=replace(foreign.display, changes=early))
    pictures = []
    for name, predicts in (("plain", False), ("tinted", True)):
        save_track_picture(tmp_path / f"{name}.png", short, predicts)
        pictures.append(cv2.imread(str(tmp_path / f"{name}.png"))[..., ::-1])
    blue = [(each[..., 2].astype(int) - each[..., 0] > 60).mean() for each in pictures]
    assert blue[1] > blue[0] + 0.03


def test_frames_with_predictions_are_the_same_whatever_was_drawn_before(foreign):
    frames = TrackFrames(foreign, 320, predicts=True)
    for time_s in (3.0, 30.0, 0.0):
        assert (frames.draw(time_s) == TrackFrames(foreign, 320, predicts=True).draw(time_s)).all()
