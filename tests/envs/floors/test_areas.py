"""Pictures with several free areas."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.areas import around, floor_of_area
from lidarium.envs.floors.catalogue.names import describe_floor
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.importers import load_file
from lidarium.envs.settings.making import make_settings

SIDE = 0.1


def track(margin):
    """A ring 2 m wide of 10 x 8 m around free space, and as much margin outside [cells]."""
    free = np.ones((80 + 2 * margin, 100 + 2 * margin), np.bool_)
    inside = free[margin : margin + 80, margin : margin + 100]
    inside[:] = False
    inside[2:-2, 2:-2] = True
    inside[22:-22, 22:-22] = False
    inside[24:-24, 24:-24] = True
    return free


def area(floor):
    return float((floor.cells.solid == 0).sum()) * SIDE**2


RING = 96 * 76 * SIDE**2 - 56 * 36 * SIDE**2
INFIELD = 52 * 32 * SIDE**2


@pytest.mark.parametrize("margin", [4, 40, 150])
def test_what_lies_around_a_track_is_no_floor(margin):
    floor = floor_of_area("track", track(margin), (0.0, 0.0), SIDE)
    assert area(floor) == pytest.approx(RING)
    # Where what lies around is smaller than the track there is nothing to choose.
    assert ("outside" in floor.remark) == (margin > 4)


def test_the_area_of_the_starts_stays_free():
    floor = floor_of_area("track", track(20), (-2.0, -2.0), SIDE)
    infield = around(floor, np.array([[5.0, 4.0, 0.0]]))
    assert area(infield) == pytest.approx(INFIELD)
    outside = around(floor, np.array([[-1.0, -1.0, 0.0]]))
    assert area(outside) == pytest.approx(140 * 120 * SIDE**2 - 100 * 80 * SIDE**2)
    assert around(floor, np.array([[1.0, 1.0, 0.0]])).sha256 == floor.sha256
    for place in ([5.0, 1.81, 0.0], [99.0, 4.0, 0.0]):
        assert area(around(floor, np.array([place]))) in (pytest.approx(RING), pytest.approx(INFIELD))


def test_a_room_that_is_cut_within_its_walls_stays_the_floor():
    free = np.ones((60, 80), np.bool_)
    free[20:30, 20:30] = False
    free[22:28, 22:28] = True
    free[45:47, 10:70] = False
    floor = floor_of_area("room", free, (0.0, 0.0), SIDE)
    assert area(floor) > 40.0
    assert "border" in floor.remark


def test_areas_that_are_left_out_are_told():
    free = np.zeros((60, 80), np.bool_)
    free[5:40, 5:70] = True
    free[45:50, 5:70] = True
    floor = floor_of_area("house", free, (0.0, 0.0), SIDE)
    assert area(floor) == pytest.approx(35 * 65 * SIDE**2)
    assert floor.remark == "3.3 m2 in one other area cannot be reached and are left out"
    assert floor.left_out_m2 == pytest.approx(5 * 65 * SIDE**2)
    assert area(around(floor, np.array([[1.0, 4.7, 0.0]]))) == pytest.approx(5 * 65 * SIDE**2)


def test_robots_start_where_they_are_asked_to(tmp_path):
    np.save(tmp_path / "track.npy", ~track(20))
    env = ExplorationEnv(tmp_path / "track.npy", make_settings(robots=1), image_resolution=SIDE)
    for place, free_m2 in (((3.0, 2.8, 0.0), RING), ((7.0, 6.0, 0.0), INFIELD)):
        env.reset(seed=0, options={"starts": [place]})
        assert area(env.floor) == pytest.approx(free_m2)
        np.testing.assert_allclose(env.world.poses[0], place)


def test_a_record_of_robots_in_another_area_is_run_again(tmp_path):
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.episodes.watching import WatchedExploration
    from lidarium.evaluation.record import Recorder
    from lidarium.evaluation.record.replay import rerun

    np.save(tmp_path / "track.npy", ~track(20))
    recorder = Recorder("nearest_frontier", 0, str(tmp_path / "track.npy"), SIDE)
    env = WatchedExploration(
        tmp_path / "track.npy",
        make_settings(robots=1, horizon_s=2.0),
        image_resolution=SIDE,
        watchers=[recorder],
    )
    run_episode(lidarium.policy("nearest_frontier"), env, 0, {"starts": [(7.0, 6.0, 0.0)]})
    again = rerun(recorder.finish(is_interrupted=False))
    assert again.floor.sha256 == env.floor.sha256


def test_a_hall_behind_a_wall_of_glass_is_told(shared_cases):
    described = describe_floor(load_file(shared_cases / "areas-left-out" / "map.yaml"))
    assert described["reachable_m2"] == pytest.approx(66.7, abs=0.1)
    assert described["whole_m2"] == pytest.approx(120.1, abs=0.1)
    assert described["remark"] == "53.4 m2 in one other area cannot be reached and are left out"


def test_what_lies_behind_an_opening_that_is_too_narrow_is_told():
    walls = [np.array([[4.0, 0.0], [4.1, 0.0], [4.1, 2.8], [4.0, 2.8]])]
    for gap, left in ((0.8, 0.0), (0.2, 1.9 * 3.0)):
        wall = walls[0].copy()
        wall[2:, 1] = 3.0 - gap
        described = describe_floor(Floor("two", (0.0, 0.0, 6.0, 3.0), (Solid(wall),)))
        assert described["whole_m2"] - described["reachable_m2"] == pytest.approx(left, abs=0.25)
        assert ("cannot be reached" in described["remark"]) == (left > 0.0)
