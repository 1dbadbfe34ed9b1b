"""Films of a run: frames at equal intervals of simulated time."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import BORDER, Frame, View
from lidarium.envs.drawing.rendering import draw_frame
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.drawing.films.formats import FilmSettings
from lidarium.evaluation.drawing.films.writing import FilmWriter, film_writer
from lidarium.evaluation.episodes.watching import Watcher

DrawOver = Callable[[ExplorationEnv, Frame, View], None]

HELD_S, LAST_FRAME_S = 1.8, 1.5
"""How long a film holds what has just happened, and its last picture [s]."""


class Frames(Protocol):
    """Draws an episode as it runs."""

    def happens(self, env: ExplorationEnv) -> bool:
        """Whether something has happened, since the frame before, that a film holds."""

    def draw(self, env: ExplorationEnv) -> Frame:
        """Return the frame of this moment."""


class ScanFrames:
    """The floor, what of it is explored, the robots and what their lasers see.

    Parameters
    ----------
    width : int
        Of a frame, but for what a camera sees beside it [pixels].
    draw_over : callable or None
        Takes the environment, a frame and the view on the floor, and draws what else is to be seen.
    """

    def __init__(self, width: int, draw_over: DrawOver | None = None) -> None:
        self._size, self._draw_over = width - 2 * BORDER, draw_over

    def happens(self, env: ExplorationEnv) -> bool:
        """Nothing is held: what is drawn over frames stays for a while."""
        return False

    def draw(self, env: ExplorationEnv) -> Frame:
        """Return the frame of this moment."""
        over = None if self._draw_over is None else partial(self._draw_over, env)
        return draw_frame(env.scene(), self._size, over)


class Film(Watcher):
    """Takes frames of an environment at equal simulated time; a ``Watcher``.

    Parameters
    ----------
    writer : FilmWriter
        Takes the frames.
    frames : Frames
        Draws them.
    speed : float
        Simulated seconds per second of the film.
    """

    def __init__(self, writer: FilmWriter, frames: Frames, speed: float) -> None:
        self.writer, self._frames = writer, frames
        self._period_s, self._taken = speed / writer.rate, 0

    def begin(self, env: ExplorationEnv) -> None:
        """Take the first frame."""
        self._take(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64]) -> None:
        """Take a frame where it is time for one."""
        self._take(env)

    def _take(self, env: ExplorationEnv) -> None:
        due = math.floor((env.scorer.time + 1e-9) / self._period_s) + 1 - self._taken
        self._taken += due
        if self._frames.happens(env):
            self.writer.hold(self._frames.draw(env), HELD_S)
        elif due:
            # Several, where the film is slower than the time steps are.
            self.writer.hold(self._frames.draw(env), due / self.writer.rate)

    def end(self, env: ExplorationEnv) -> None:
        """Hold the last picture for a moment."""
        self.writer.hold(self._frames.draw(env), LAST_FRAME_S)


@contextmanager
def film(path: Path, frames: Frames, settings: FilmSettings | None = None) -> Iterator[Film]:
    """Film a run.

    Parameters
    ----------
    path : Path
        The film, mp4, GIF or WebP by its ending; it appears when the film is finished, also where the run was
        interrupted.
    frames : Frames
        Draws the frames.
    settings : FilmSettings or None
        How fast and wide it is.

    Raises
    ------
    ValueError
        Where films do not end so.
    OSError
        Where it cannot be written whole.
    """
    settings = settings or FilmSettings()
    with film_writer(path, settings) as writer:
        yield Film(writer, frames, settings.speed)
