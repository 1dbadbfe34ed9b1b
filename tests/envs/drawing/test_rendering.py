import pickle

import numpy as np
import pytest

import lidarium
from lidarium.envs.drawing.rendering import EXPLORED, PALETTE, classify, draw_frame, team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.making import make_settings


def small_floor(width=4.0, height=3.0):
    pillar = Solid(np.array([(1.5, 1.2), (1.9, 1.2), (1.9, 1.6), (1.5, 1.6)]))
    return Floor("small", (0.0, 0.0, width, height), (pillar,))


def started(floor=None, **options):
    env = ExplorationEnv(
        floor or small_floor(), make_settings(**{"robots": 2, "resolution": 0.05, **options}), "rgb_array"
    )
    env.reset(seed=0)
    return env


@pytest.mark.parametrize(("width", "height"), [(4.0, 3.0), (3.0, 5.0), (12.0, 2.0)])
def test_a_frame_is_a_picture_of_the_asked_size_with_even_sides(width, height):
    frame = draw_frame(started(small_floor(width, height)).scene(), 320)
    assert frame.dtype == np.uint8
    assert frame.ndim == 3
    assert frame.shape[2] == 3
    assert frame.shape[0] % 2 == frame.shape[1] % 2 == 0
    assert 320 <= max(frame.shape) <= 420


def test_rgb_array_renders_what_draw_frame_draws():
    env = started()
    assert np.array_equal(env.render(), draw_frame(env.scene()))


def test_a_frame_belongs_to_the_caller():
    env = started()
    frame = draw_frame(env.scene())
    frame[:] = 7
    assert (draw_frame(env.scene()) != 7).any()


def test_exploring_turns_floor_white():
    env = started("apartment", robots=1)
    before = (draw_frame(env.scene()) == EXPLORED).all(axis=2).sum()
    for _ in range(60):
        env.step({"robot_0": np.array([0.0, 0.4], np.float32)})
    assert (draw_frame(env.scene()) == EXPLORED).all(axis=2).sum() > before


def test_cells_are_drawn_by_what_they_are_and_what_is_seen():
    solid = np.zeros((9, 24), np.uint8)
    solid[:, :6] = 1
    counted = np.ones_like(solid) - solid
    counted[:, 6] = 0
    seen = np.zeros_like(solid)
    seen[:, 7:12] = 1
    classes = classify(solid, seen, counted, 0.1)
    assert PALETTE[classes[4]].shape == (24, 3)
    assert classes[4, [0, 6, 8, 20]].tolist() == [0, 3, 4, 2]
    assert classify(solid, np.roll(seen, -1, axis=1), counted, 0.1)[4, 5] == 1


def test_maps_of_coarser_cells_lie_on_the_same_floor():
    fine, coarse = (draw_frame(started(resolution=resolution).scene(), 400) for resolution in (0.025, 0.1))
    assert fine.shape == coarse.shape
    assert np.abs(fine.astype(int) - coarse).mean() < 12.0


def test_a_floor_of_more_cells_than_pixels_keeps_its_walls_and_what_is_explored():
    env = started("apartment")
    small, large = (draw_frame(env.scene(), size)[60:] for size in (150, 900))
    for colour in PALETTE:
        shares = [(np.abs(frame.astype(int) - colour).sum(axis=2) < 12).mean() for frame in (small, large)]
        assert shares[0] > 0.0
        assert shares[1] > 0.0


def test_the_whole_team_has_colours_of_its_own():
    colours = team_colours(64)
    assert len(set(colours)) == 64
    assert all(0 <= channel <= 255 for colour in colours for channel in colour)


def test_a_frame_needs_a_reset_and_room():
    with pytest.raises(ValueError, match="reset"):
        draw_frame(ExplorationEnv(small_floor(), make_settings(robots=1)).scene())
    with pytest.raises(ValueError, match="size of the frame is 10"):
        draw_frame(started().scene(), 10)


def test_an_environment_that_was_drawn_can_be_pickled():
    env = started()
    env.render()
    assert np.array_equal(pickle.loads(pickle.dumps(env)).render(), env.render())


def test_levels_of_decision_render_too():
    env = lidarium.parallel_env(small_floor(), level="waypoint", render_mode="rgb_array", robots=1, starts="fixed")
    env.reset(seed=1)
    assert env.render().ndim == 3
    env.close()
