"""Controls say what was last chosen, and show where the run is."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_scene import RecordedServer

from lidarium.evaluation.viewing.controls import (
    BEHIND,
    NOBODY,
    OF_CAMERAS,
    PAUSE,
    RESUME,
    SPEEDS,
    Controls,
    Layer,
    follow,
)

AGENTS = ["robot_0", "robot_1"]


def made(has_cameras=False, heights=(2.5, 1.2), predicts=False, **choices):
    server = RecordedServer(**choices)
    return Controls(server, AGENTS, has_cameras, heights, predicts=predicts), server.gui.controls


def test_a_run_waits_from_a_click_to_the_next():
    controls, boxes = made()
    seen = [(controls.is_paused, boxes[PAUSE].label)]
    for _ in range(2):
        boxes[PAUSE].press()
        seen.append((controls.is_paused, boxes[PAUSE].label))
    assert seen == [(False, PAUSE), (True, RESUME), (False, PAUSE)]


@pytest.mark.parametrize("name", SPEEDS)
def test_the_speed_is_the_one_that_was_chosen(name):
    speed = made(Speed=name)[0].speed
    assert speed == (math.inf if name.startswith("As") else float(name.removesuffix(" x")))


def test_a_robot_is_followed_by_its_number():
    controls, boxes = made()
    assert boxes["Follow"].options == (NOBODY, *AGENTS)
    assert controls.followed is None
    boxes["Follow"].value = "robot_1"
    assert controls.followed == 1


def test_layers_are_those_that_are_ticked_and_of_cameras_only_where_there_are_any():
    controls, boxes = made()
    assert controls.layers == frozenset(Layer) - {*OF_CAMERAS, Layer.PREDICTION}
    boxes[Layer.SCANS.value].value = False
    assert Layer.SCANS not in controls.layers
    assert made(has_cameras=True, predicts=True)[0].layers == frozenset(Layer)


def test_walls_are_cut_where_the_slider_stands_and_no_higher_than_they_are():
    controls, boxes = made(heights=(2.5, 1.2))
    assert controls.wall_height == 1.2
    boxes["Walls cut [m]"].value = 0.4
    assert controls.wall_height == 0.4
    assert made(heights=(0.8, 1.2))[0].wall_height == 0.8


def test_words_coverage_and_depth_images_are_shown():
    controls, boxes = made(has_cameras=True)
    texts = [box for name, box in boxes.items() if name.startswith("html")]
    controls.write("<b>here</b>", "<i>this</i>", 0.425)
    assert [text.content for text in texts] == ["<b>here</b>", "<i>this</i>"]
    assert boxes["progress"].value == pytest.approx(42.5)
    controls.write("", "", 1.2)
    assert boxes["progress"].value == 100.0
    picture = np.full((3, 4, 3), 7, np.uint8)
    controls.show_depth(picture)
    assert boxes["Depth image"].image is picture


def test_a_run_that_is_over_cannot_be_paused():
    controls, boxes = made()
    pause = boxes[PAUSE]
    pause.press()
    controls.end()
    assert not controls.is_paused
    assert pause.label == "The run is over"
    assert pause.disabled
    assert boxes["Speed"].disabled


def test_cameras_of_all_browsers_move_with_the_robot():
    server = RecordedServer()
    for name in ("one", "other"):
        camera = SimpleNamespace(position=np.array([1.0, 1.0, 5.0]), look_at=np.zeros(3))
        server.clients[name] = SimpleNamespace(camera=camera)
    here = np.array([2.0, 3.0, 0.0])
    follow(server, here, None)
    for client in server.clients.values():
        assert client.camera.position == pytest.approx(here + np.array(BEHIND))
        assert client.camera.look_at == pytest.approx(here)
    # Who has moved the camera keeps the view from there.
    server.clients["other"].camera.position = np.array([0.0, 0.0, 9.0])
    gone = np.array([0.5, -0.25, 0.0])
    follow(server, here + gone, here)
    assert server.clients["other"].camera.position == pytest.approx([0.5, -0.25, 9.0])
    assert server.clients["one"].camera.position == pytest.approx(here + np.array(BEHIND) + gone)
