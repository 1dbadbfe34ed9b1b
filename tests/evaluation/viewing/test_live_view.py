"""A run shown in a browser while it goes."""

import math
import signal
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_scene import RecordedServer

import lidarium
from lidarium.agents.policy import settings_for
from lidarium.envs.drawing.frame_parts import UNEXPLORED
from lidarium.envs.drawing.prediction_layer import PREDICTED
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.viewing.controls import PAUSE, RESUME
from lidarium.evaluation.viewing.live_view import (
    LONGEST_WAIT_S,
    MOST_BEHIND_S,
    LiveView,
    Pace,
    events_text,
    status_text,
)

PATIENCE_S = 600.0
"""How long a busy machine may take, which may have kernels to compile [s]."""

SETTINGS = make_settings(robots=2, horizon_s=8.0, resolution=0.05)
APART = make_settings(
    robots=2,
    horizon_s=8.0,
    resolution=0.05,
    known_starts=False,
    localization="slam",
    noise="datasheet",
    odometry="typical",
)


WITH_CAMERA = settings_for(
    lidarium.policy("sparse_frontier"),
    make_settings(robots=1, horizon_s=3.0, resolution=0.05, camera="xtion_tilted"),
)


class AtStep(Watcher):
    """Does something after a number of steps."""

    def __init__(self, steps, act):
        self._left, self._act = steps, act

    def step(self, env, commands):
        self._left -= 1
        if self._left == 0:
            self._act()


def quick(policy):
    """A view that draws every step and waits for nothing, and what it draws."""
    server = RecordedServer(Speed="As fast as it goes")
    return server, LiveView(server, policy, "a policy", clock=iter(range(10**6)).__next__)


def seen(settings, policy_name="nearest_frontier", floor="apartment", watchers=(), seed=3, **options):
    """Run an episode before a view; return its server and the environment."""
    policy = lidarium.policy(policy_name)
    server, view = quick(policy)
    env = WatchedExploration(floor, settings, watchers=[*watchers, view])
    episode = run_episode(policy, env, seed, **options)
    return SimpleNamespace(server=server, env=env, view=view, episode=episode, nodes=server.scene.nodes)


@pytest.mark.parametrize(
    ("settings", "policy", "floor"),
    [
        (SETTINGS, "nearest_frontier", "apartment"),
        (SETTINGS, "tour_frontier", "apartment"),
        (SETTINGS, "predicted_tours", "apartment"),
        (APART, "supervised", "apartment"),
        (SETTINGS, "random_walk", "apartment"),
        (WITH_CAMERA, "sparse_frontier", "open_apartment"),
    ],
)
def test_a_viewed_run_is_the_same_to_the_bit(settings, policy, floor):
    viewed, env = seen(settings, policy, floor).env, ExplorationEnv(floor, settings)
    run_episode(lidarium.policy(policy), env, seed=3)
    np.testing.assert_array_equal(viewed.world.poses, env.world.poses)
    np.testing.assert_array_equal(viewed.simulation.beliefs.log_odds, env.simulation.beliefs.log_odds)
    np.testing.assert_array_equal(viewed.simulation.ranges, env.simulation.ranges)
    assert viewed.scorer.times == env.scorer.times


def test_robots_are_drawn_where_they_are_and_where_they_believe_to_be():
    run = seen(APART, "supervised")
    for row, (x, y, theta) in enumerate(run.env.world.poses):
        body = run.nodes[f"/robots/robot_{row}"]
        assert np.allclose(body.position, (x, y, 0.0))
        assert np.allclose(body.wxyz, (np.cos(theta / 2), 0.0, 0.0, np.sin(theta / 2))) or np.allclose(
            body.wxyz, (-np.cos(theta / 2), 0.0, 0.0, -np.sin(theta / 2))
        )
        believed = run.nodes[f"/believed/robot_{row}"].position
        off = np.hypot(*(believed[:2] - (x, y)))
        assert 0.0 < off < 0.2
    assert run.view.has_ended


def test_the_page_says_where_the_run_is():
    run = seen(SETTINGS)
    text = run.server.gui.controls["html 0"].content
    assert "apartment" in text
    assert "8.0 s" in text
    assert f"{100 * run.env.scorer.coverage:.1f} %" in text
    assert f"{len(run.episode.decision_seconds)}" in text
    assert run.server.gui.controls["progress"].value == pytest.approx(100 * run.env.scorer.coverage)


def test_layers_come_and_go():
    run = seen(SETTINGS)
    boxes, view = run.server.gui.controls, run.view
    layers = {
        "True walls": "/floor/0",
        "Robots": "/robots/robot_0",
        "Believed poses": "/believed/robot_1",
        "Scans": "/scans/robot_0",
        "Paths driven": "/trails/robot_0",
        "Plans and goals": "/plans/robot_1",
        "Frontiers": "/frontiers",
    }
    for label, node in layers.items():
        assert run.nodes[node].visible, label
        boxes[label].value = False
        view._answer_controls()
        assert not run.nodes[node].visible, label
    both = run.nodes["/ground"].image
    boxes["Joined map"].value = False
    view._answer_controls()
    own = run.nodes["/ground"].image
    assert (own != both).any()
    boxes["Own maps"].value = False
    view._answer_controls()
    assert len(np.unique(run.nodes["/ground"].image.reshape(-1, 3), axis=0)) == 1


def test_walls_are_cut_where_the_slider_says():
    run = seen(SETTINGS)
    run.server.gui.controls["Walls cut [m]"].value = 1.0
    run.view._answer_controls()
    assert max(node.given[0][:, 2].max() for name, node in run.nodes.items() if "/floor/" in name) == 1.0


def test_a_camera_follows_a_robot():
    policy = lidarium.policy("nearest_frontier")
    server, view = quick(policy)
    camera = SimpleNamespace(position=np.array([1.0, 2.0, 3.0]), look_at=np.zeros(3))
    server.clients[0] = SimpleNamespace(camera=camera)

    def choose():
        server.gui.controls["Follow"].value = "robot_1"

    env = WatchedExploration("apartment", SETTINGS, watchers=[AtStep(5, choose), view])
    run_episode(policy, env, 3)
    there = env.world.poses[1, :2]
    assert np.allclose(camera.position[:2] - there, (0.0, -4.5))
    assert camera.position[2] == 6.0


def test_a_pause_holds_the_run_until_it_goes_on():
    policy, held = lidarium.policy("nearest_frontier"), threading.Event()
    server, view = quick(policy)

    def pause():
        server.gui.controls[PAUSE].press()
        held.set()

    env = WatchedExploration("apartment", SETTINGS, watchers=[AtStep(3, pause), view])
    run = threading.Thread(target=run_episode, args=(policy, env, 3))
    run.start()
    assert held.wait(PATIENCE_S)
    button = server.gui.controls[PAUSE]
    run.join(0.3)
    assert run.is_alive()
    assert env.scorer.time == pytest.approx(0.3)
    assert button.label == RESUME
    button.press()
    run.join(PATIENCE_S)
    assert not run.is_alive()
    assert env.scorer.time == pytest.approx(8.0)


@pytest.fixture
def usual_interrupts():
    """Ctrl-C as it is in a program of its own: other tests of this process may have left a handler."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("usual_interrupts")
def test_an_interrupt_ends_a_paused_run():
    policy = lidarium.policy("nearest_frontier")
    server, view = quick(policy)

    def pause():
        server.gui.controls[PAUSE].press()
        signal.raise_signal(signal.SIGINT)

    env = WatchedExploration("apartment", SETTINGS, watchers=[AtStep(3, pause), view])
    episode = run_episode(policy, env, 3, raise_interrupt=False)
    assert episode.is_interrupted
    assert env.scorer.time < 8.0
    assert not view.has_ended


def test_depth_images_and_sparse_maps_are_shown_where_there_are_cameras():
    run = seen(WITH_CAMERA, "sparse_frontier", "open_apartment")
    cloud, boxes = run.nodes["/clouds/robot_0"].points, run.nodes["/boxes/robot_0/all"].given[0]
    x_min, y_min, x_max, y_max = run.env.floor.bounds
    assert len(cloud) > 500
    assert ((cloud > (x_min - 0.1, y_min - 0.1, -0.2)) & (cloud < (x_max + 0.1, y_max + 0.1, 3.0))).all()
    assert len(boxes) % 8 == 0
    assert len(boxes)
    assert run.server.gui.controls["Depth image"].image.std() > 0.0


def test_sparse_maps_that_no_policy_asks_for_are_not_made():
    run = seen(WITH_CAMERA, "nearest_frontier", "open_apartment")
    assert run.env.perception.sparse_maps.made == {}
    assert "/boxes/robot_0/all" not in run.nodes
    assert len(run.nodes["/clouds/robot_0"].points) > 500


def test_layers_of_cameras_are_not_offered_without_cameras():
    assert "Depth images" not in seen(SETTINGS).server.gui.controls


def test_another_episode_has_the_page_for_itself():
    policy = lidarium.policy("nearest_frontier")
    server, view = quick(policy)
    env = WatchedExploration("apartment", SETTINGS, watchers=[view])
    run_episode(policy, env, 3)
    once = set(server.scene.nodes), set(server.gui.controls)
    run_episode(policy, env, 4)
    assert (set(server.scene.nodes), set(server.gui.controls)) == once
    assert view.has_ended


def test_who_is_chosen_while_the_run_stands_is_looked_at():
    run = seen(SETTINGS)
    camera = SimpleNamespace(position=np.zeros(3), look_at=np.zeros(3))
    run.server.clients[0] = SimpleNamespace(camera=camera)
    run.server.gui.controls["Follow"].value = "robot_0"
    run.view._answer_controls()
    assert np.allclose(camera.look_at[:2], run.env.world.poses[0, :2])
    camera.position = np.array([9.0, 9.0, 9.0])  # as a person turns the view
    run.view._answer_controls()
    assert np.array_equal(camera.position, (9.0, 9.0, 9.0))


class Wall:
    """A clock that sleeping turns on."""

    def __init__(self):
        self.now = 100.0

    def sleep(self, seconds):
        assert seconds >= 0.0
        self.now += seconds


@pytest.fixture
def wall():
    return Wall()


@pytest.fixture
def pace(wall):
    return Pace(lambda: wall.now, wall.sleep)


def drive(pace, times, speed, is_held=lambda: False, meanwhile=lambda: True):
    for time_s in times:
        pace.wait(time_s, speed, is_held, meanwhile)


def test_two_simulated_seconds_take_one_at_twice_the_speed(pace, wall):
    drive(pace, [0.1 * k for k in range(1, 102)], lambda: 2.0)
    assert wall.now - 100.0 == pytest.approx(5.0)


def test_as_fast_as_it_goes_waits_for_nothing(pace, wall):
    drive(pace, range(1, 1000), lambda: math.inf)
    assert wall.now == 100.0


def test_a_speed_that_is_chosen_later_counts_from_then_on(pace, wall):
    speed = [1.0]
    drive(pace, [1.0, 2.0], lambda: speed[0])
    speed[0] = 10.0
    drive(pace, [3.0, 13.0], lambda: speed[0])
    assert wall.now - 100.0 == pytest.approx(1.0 + 1.0, abs=1e-6)


def test_a_late_run_does_not_hurry_after_the_clock(pace, wall):
    drive(pace, [1.0], lambda: 1.0)
    wall.now += 20.0 * MOST_BEHIND_S
    drive(pace, [1.1], lambda: 1.0)
    late = wall.now
    drive(pace, [1.2, 2.1], lambda: 1.0)
    assert wall.now - late == pytest.approx(1.0)


def test_time_stands_while_it_is_held_and_goes_on_from_there(pace, wall):
    drive(pace, [1.0], lambda: 1.0)
    drive(pace, [2.0], lambda: 1.0, is_held=lambda: wall.now < 150.0)
    released = wall.now
    assert released >= 150.0
    drive(pace, [3.0], lambda: 1.0)
    assert wall.now - released == pytest.approx(1.0, abs=LONGEST_WAIT_S + 1e-6)


def test_who_is_not_to_wait_any_more_does_not(pace, wall):
    asked = iter([True, True, False])
    drive(pace, [1.0], lambda: 1.0, is_held=lambda: True, meanwhile=lambda: next(asked))
    assert wall.now < 101.0


EVIL = "<img src=x onerror=alert(1)>"


def test_names_are_shown_as_text():
    floor = replace(load_floor("apartment"), name=EVIL)
    env = WatchedExploration(floor, make_settings(robots=1, horizon_s=2.0, resolution=0.05))
    policy = lidarium.policy("nearest_frontier")
    run_episode(policy, env, 0)
    text = status_text(env, EVIL, policy.report(), 7)
    assert "<img" not in text
    assert text.count("&lt;img") == 2
    assert "<td>Decisions</td>" in text
    assert ">7</td>" in text


def test_what_a_station_did_is_listed_last_things_first():
    settings = make_settings(robots=2, horizon_s=60.0, resolution=0.05, known_starts=False, localization="slam")
    policy, env = lidarium.policy("supervised"), WatchedExploration("apartment", settings)
    run_episode(policy, env, 0)
    report = policy.report()
    used = [join for join in report.supervision.joins if join.is_used]
    assert used
    assert f">{len(used)}</td>" in status_text(env, "supervised", report, 30)
    text = events_text(env, report)
    times = [float(part.split(" s<")[0].rsplit(">", 1)[1]) for part in text.split("<tr>")[1:]]
    assert 1 <= len(times) <= 6
    assert times == sorted(times, reverse=True)


def test_the_prediction_is_a_layer_that_is_shown_at_first_if_robots_predict():
    for policy, is_shown in (("nearest_frontier", False), ("predicted_tours", True)):
        run = seen(SETTINGS, policy)
        box = run.server.gui.controls["Prediction"]
        assert box.value == is_shown
        first = run.nodes["/ground"].image
        box.value = not is_shown
        run.view._answer_controls()
        pictures = (run.nodes["/ground"].image, first) if is_shown else (first, run.nodes["/ground"].image)
        without, tinted = (picture.reshape(-1, 3) for picture in pictures)
        differs = (without != tinted).any(axis=1)
        assert differs.any()
        assert (without[differs] == UNEXPLORED).all()
        assert (tinted[differs, 0] < UNEXPLORED[0]).all()
        assert tinted[:, 0].min() >= PREDICTED[0]


def test_without_maps_nothing_is_predicted():
    run = seen(SETTINGS, "predicted_tours")
    for label in ("Joined map", "Own maps"):
        run.server.gui.controls[label].value = False
    run.view._answer_controls()
    assert (run.nodes["/ground"].image == UNEXPLORED).all()
