"""Films: their frames at equal simulated time, their formats, and their files."""

import os
import subprocess
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest
from films_read import read_film, share_of

import lidarium
from lidarium.envs.drawing.frame_parts import EXPLORED, team_colours
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.drawing import films
from lidarium.evaluation.drawing.films import (
    FORMATS,
    Film,
    FilmSettings,
    PredictionFrames,
    ScanFrames,
    film_writer,
    format_of,
)
from lidarium.evaluation.drawing.films import filmed as opened
from lidarium.evaluation.drawing.map_film import JOINED, MapFrames
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration


def filmed(path, frames_of, settings, policy="nearest_frontier", **options):
    """Film a run of two robots; return its episode and its film."""
    chosen = {"robots": 2, "resolution": 0.05, "horizon_s": 6.0, **options}
    env, decides = WatchedExploration("apartment", make_settings(**chosen)), lidarium.policy(policy)
    with opened(path, frames_of(decides), settings) as camera:

        def begin(current):
            if camera not in env.watchers:
                camera.begin(current)
                env.watchers.append(camera)

        episode = run_episode(decides, env, 0, on_decision=begin)
        assert not path.exists()
        camera.end(env)
    return episode, read_film(path)


@pytest.mark.parametrize(("ending", "rate"), [(".mp4", 20), (".gif", 10), (".webp", 10)])
def test_a_film_has_frames_at_equal_simulated_time(tmp_path, ending, rate):
    path = tmp_path / f"run{ending}"
    settings = FilmSettings(speed=float(rate), width=360)
    _, found = filmed(path, lambda policy: ScanFrames(policy, 360), settings)
    # A frame at 0, 1, ... 6 s, and the last one held for 1.5 s.
    assert found.seconds == pytest.approx((7 + 1.5 * rate) / rate)
    assert found.frames.shape[2] == 360
    assert share_of(found.frames[0], EXPLORED) < share_of(found.frames[-1], EXPLORED)
    assert all(share_of(found.frames[k], colour) > 1e-4 for k in (0, -1) for colour in team_colours(2))
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_a_slow_film_has_several_frames_of_a_time_step(tmp_path):
    settings = FilmSettings(speed=1.0, width=360, frames_per_second=20)
    _, found = filmed(tmp_path / "run.mp4", lambda policy: ScanFrames(policy, 360), settings, horizon_s=1.0)
    # Frames at 0, 0.05, ... 1 s.
    assert len(found.frames) == 21 + 30


def test_maps_are_in_their_robots_colours_until_they_are_joined(tmp_path):
    # On coarse maps the station joins the two within this time.
    options = {"known_starts": False, "horizon_s": 34.0, "resolution": 0.1}
    settings = FilmSettings(speed=10.0, width=480)
    episode, found = filmed(
        tmp_path / "run.gif", lambda policy: MapFrames(policy, 480), settings, "supervised", **options
    )
    joins = [join for join in episode.policy.report().supervision.joins if join.is_used]
    assert joins
    assert found.frames.shape[2] == 480
    first, last = found.frames[0], found.frames[-1]
    assert all(share_of(first, colour) > 0.005 for colour in team_colours(2))
    assert share_of(first, EXPLORED) < share_of(last, EXPLORED)
    assert share_of(first, JOINED) == 0.0
    assert max(share_of(frame, JOINED) for frame in found.frames) > 0.02
    # Each time at which maps are joined is held for 1.8 s, and the last frame for 1.5 s.
    assert found.seconds > episode.env.scorer.time / 10.0 + 1.8 + 1.5 - 0.2


class Counted:
    """Frames of one colour each, of which something happens at one time."""

    def __init__(self, at_s):
        self.at_s, self.times = at_s, []

    def happens(self, env):
        return env.scorer.time == pytest.approx(self.at_s)

    def draw(self, env):
        self.times.append(env.scorer.time)
        return np.zeros((90, 120, 3), np.uint8)


class Shelf:
    """A writer that counts."""

    rate = 10.0

    def __init__(self):
        self.held = []

    def append_data(self, frame):
        self.held.append(1)

    def hold(self, frame, seconds):
        self.held.append(round(seconds * self.rate))


def test_what_happens_between_frames_is_held():
    env = WatchedExploration("apartment", make_settings(robots=1, resolution=0.05, horizon_s=3.0))
    frames, shelf = Counted(1.5), Shelf()
    env.watchers.append(Film(shelf, frames, speed=10.0))
    run_episode(lidarium.policy("random_walk"), env, 0)
    assert frames.times == pytest.approx([0.0, 1.0, 1.5, 2.0, 3.0])
    assert shelf.held == [1, 1, 18, 1, 1]


@pytest.mark.parametrize("name", ["a.mp4", "a.gif", "a.webp", "A.GIF", "b.mp4.gif"])
def test_an_ending_is_a_format(name):
    assert format_of(Path(name)) is FORMATS[name[name.rindex(".") :].lower()]


@pytest.mark.parametrize("name", ["a.avi", "a", "gif", "a.gif.txt", ".gif"])
def test_other_endings_are_refused_with_those_that_are_known(name):
    with pytest.raises(ValueError, match=r"want one of \.mp4, \.gif, \.webp"):
        format_of(Path(name))


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan"), float("inf")])
def test_a_film_runs_forward(speed):
    with pytest.raises(ValueError, match="speed of the film is"):
        FilmSettings(speed)


@pytest.mark.parametrize("width", [0, 119, 4097])
def test_a_film_has_a_width(width):
    with pytest.raises(ValueError, match=f"width of the film is {width} pixels"):
        FilmSettings(width=width)


@pytest.mark.parametrize("rate", [0.0, 51.0, float("nan")])
def test_a_film_has_frames(rate):
    with pytest.raises(ValueError, match="frames per second"):
        FilmSettings(frames_per_second=rate)


def test_what_is_left_out_is_as_the_format_has_it():
    assert FilmSettings().width_of(Path("a.mp4")) == 980
    assert FilmSettings().rate_of(Path("a.gif")) == 10.0
    assert FilmSettings(width=300, frames_per_second=5).width_of(Path("a.gif")) == 300
    assert FilmSettings(width=300, frames_per_second=5).rate_of(Path("a.mp4")) == 5


ENDINGS = [".mp4", ".gif", ".webp"]
BLUE, ORANGE, WHITE = (37, 99, 235), (234, 88, 12), (255, 255, 255)


def frame_of(number, rows=90, columns=160):
    """A blue square that moves over white, and an orange one that stays."""
    frame = np.full((rows, columns, 3), 255, np.uint8)
    frame[10:30, 5 * number : 5 * number + 20] = BLUE
    frame[50:80, 100:140] = ORANGE
    return frame


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_has_the_frames_that_were_given(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path, FilmSettings(frames_per_second=10)) as writer:
        for number in range(8):
            writer.append_data(frame_of(number))
        assert not path.exists()
    film = read_film(path)
    assert film.frames.shape == (8, 90, 160, 3)
    assert film.seconds == pytest.approx(writer.seconds) == pytest.approx(0.8)
    for number in (0, 4, 7):
        assert np.abs(film.frames[number, 15:25, 5 * number + 5 : 5 * number + 15] - BLUE).max() <= 12
        assert share_of(film.frames[number], ORANGE) == pytest.approx(30 * 40 / (90 * 160), abs=0.01)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", [".gif", ".webp"])
def test_few_colours_come_back_as_they_were(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path) as writer:
        for number in range(3):
            writer.append_data(frame_of(number))
    assert {tuple(colour) for colour in read_film(path).frames[2].reshape(-1, 3)} == {BLUE, ORANGE, WHITE}


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_frame_can_be_held(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path) as writer:
        writer.append_data(frame_of(0))
        writer.hold(frame_of(1), 2.0)
    assert read_film(path).seconds == pytest.approx(writer.seconds) == pytest.approx(2.0 + 1 / writer.rate)


def test_what_does_not_change_takes_no_room(tmp_path):
    for name, seconds in (("short.gif", 1.0), ("long.gif", 60.0)):
        with film_writer(tmp_path / name) as writer:
            writer.hold(frame_of(0), seconds)
    short, long = ((tmp_path / name).stat().st_size for name in ("short.gif", "long.gif"))
    assert (long - short) / 590 < 60


@pytest.mark.parametrize("ending", ENDINGS)
def test_no_frame_is_kept(tmp_path, ending):
    given = []
    with film_writer(tmp_path / f"film{ending}") as writer:
        for number in range(60):
            frame = frame_of(number % 20)
            given.append(weakref.ref(frame))
            writer.append_data(frame)
            del frame
            assert sum(each() is not None for each in given) <= 1
    assert not any(each() is not None for each in given[:-1])


@pytest.mark.parametrize("ending", ENDINGS)
def test_wide_frames_are_made_narrower(tmp_path, ending):
    path = tmp_path / f"film{ending}"
    with film_writer(path, FilmSettings(width=241)) as writer:
        writer.append_data(frame_of(1, 300, 480))
        writer.append_data(frame_of(2, 300, 480))
    assert read_film(path).frames.shape[1:] == (150, 240, 3)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_film_that_is_broken_off_is_not_there(tmp_path, ending, error):
    def break_off():
        with film_writer(tmp_path / f"film{ending}") as writer:
            writer.append_data(frame_of(0))
            raise error

    with pytest.raises(error):
        break_off()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_film_without_frames_is_an_error(tmp_path, ending):
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / f"film{ending}"):
        pass
    assert not list(tmp_path.iterdir())


def test_a_film_of_which_the_second_pass_fails_is_not_there(tmp_path, monkeypatch):
    monkeypatch.setattr(films, "_is_done", lambda *arguments: False)
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / "film.gif") as writer:
        writer.append_data(frame_of(0))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_encoder_that_ends_early_is_an_error_without_its_command_line(tmp_path, monkeypatch, ending):
    def ends_early(*arguments, **options):
        yield
        raise OSError("FFMPEG COMMAND: ffmpeg -y")

    monkeypatch.setattr(films.imageio_ffmpeg, "write_frames", ends_early)
    with pytest.raises(OSError, match="not whole") as told, film_writer(tmp_path / f"f{ending}") as writer:
        writer.append_data(frame_of(0))
    assert "COMMAND" not in str(told.value)
    assert f"f{ending}" in str(told.value)
    assert not list(tmp_path.iterdir())


NOISE = """
import sys
from pathlib import Path
import numpy as np
from lidarium.evaluation.drawing.films import film_writer
for name in sys.argv[1:]:
    draws = np.random.default_rng(0)
    try:
        with film_writer(Path(name)) as writer:
            for _ in range(40):
                writer.append_data(draws.integers(0, 256, (90, 160, 3), np.uint8))
    except OSError as error:
        print(error)
"""


def limit_files():
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


@pytest.mark.skipif(os.name == "nt", reason="no such limits there")
def test_a_film_that_does_not_fit_is_an_error_and_is_not_there(tmp_path):
    names = [f"film{ending}" for ending in ENDINGS]
    command = [sys.executable, "-c", NOISE, *(str(tmp_path / name) for name in names)]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit_files, timeout=120)
    told = done.stdout.splitlines()
    assert len(told) == len(names), done.stderr
    for name, line in zip(names, told, strict=True):
        assert "the film is not whole" in line
        assert name in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a:b [1].gif", "it's 100 %d.mp4", "-x, y;z.webp"])
def test_names_may_have_any_letters(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with film_writer(name) as writer:
        writer.append_data(frame_of(0))
        writer.append_data(frame_of(1))
    assert len(read_film(tmp_path / name).frames) == 2


def test_an_older_film_stays_where_a_new_one_fails(tmp_path):
    (tmp_path / "film.gif").write_text("older")
    with pytest.raises(OSError, match="not whole"), film_writer(tmp_path / "film.gif"):
        pass
    assert (tmp_path / "film.gif").read_text() == "older"


def blue_of(frames, reference):
    """Return how many pixels are bluer than in another film of the same run, frame by frame."""
    change = frames.astype(int) - reference.astype(int)
    return ((change[..., 0] < -20) & (change[..., 2] > change[..., 0] + 20)).mean(axis=(1, 2))


def test_films_show_predictions_if_the_policy_predicts_or_one_asks(tmp_path):
    settings = FilmSettings(speed=10.0, width=360)

    def film(name, frames, policy, **options):
        return filmed(tmp_path / f"{name}.webp", lambda made: frames(made, 360), settings, policy, **options)[1].frames

    plain = film("plain", ScanFrames, "tour_frontier")
    asked = film("asked", PredictionFrames, "tour_frontier")
    assert blue_of(asked, plain)[0] > 0.05
    assert blue_of(asked, plain)[-1] < blue_of(asked, plain)[0]
    # At the start both policies see the same.
    assert blue_of(film("own", ScanFrames, "predicted_tours"), plain)[0] > 0.05


def test_the_film_of_maps_shows_what_each_robot_predicts(tmp_path):
    settings, first = FilmSettings(speed=10.0, width=480), []
    for policy in ("supervised_tours", "supervised_predicted"):
        _, found = filmed(
            tmp_path / f"{policy}.webp",
            lambda made: MapFrames(made, 480),
            settings,
            policy,
            known_starts=False,
            horizon_s=1.0,
            resolution=0.1,
        )
        first.append(found.frames[0])
    plain, tinted = first
    half = len(plain) // 3
    assert blue_of(tinted[None, :half], plain[None, :half])[0] > 0.02
    assert blue_of(tinted[None, half:], plain[None, half:])[0] > 0.05
