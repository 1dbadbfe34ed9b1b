"""Films of a run: frames at equal intervals of simulated time.

The film is an mp4 that is written whole or not at all.
"""

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import Frame, View
from lidarium.envs.drawing.rendering import draw_frame
from lidarium.envs.exploration import ExplorationEnv
from lidarium.evaluation.episodes.output import whole_file
from lidarium.evaluation.episodes.watching import Watcher

DrawOver = Callable[[ExplorationEnv, Frame, View], None]

FRAMES_PER_SECOND = 20

LAST_FRAME_S = 1.5
"""How long a film holds its last picture [s]."""


class Film(Watcher):
    """Takes frames of an environment at equal simulated time; a ``Watcher``.

    Parameters
    ----------
    writer : object
        With ``append_data(frame)``, as imageio's writers have it.
    period_s : float
        Simulated time between frames [s].
    size : int
        Longer side of the floor in a frame [pixels].
    draw_over : callable or None
        Takes the environment, a frame and the view on the floor, and draws what else is to be seen.
    """

    def __init__(self, writer: Any, period_s: float, size: int, draw_over: DrawOver | None = None) -> None:  # noqa: ANN401
        self._writer, self._period_s, self._size, self._draw_over = writer, period_s, size, draw_over
        self._next_s = 0.0

    def begin(self, env: ExplorationEnv) -> None:
        """Take the first frame."""
        self._take(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64]) -> None:
        """Take a frame where it is time for one."""
        self._take(env)

    def _take(self, env: ExplorationEnv) -> None:
        if env.scorer.time + 1e-9 >= self._next_s:
            self._writer.append_data(self._frame(env))
            self._next_s += self._period_s

    def end(self, env: ExplorationEnv) -> None:
        """Hold the last picture for a moment."""
        frame = self._frame(env)
        for _ in range(round(LAST_FRAME_S * FRAMES_PER_SECOND)):
            self._writer.append_data(frame)

    def _frame(self, env: ExplorationEnv) -> NDArray[np.uint8]:
        return draw_frame(
            env.scene(), self._size, None if self._draw_over is None else partial(self._draw_over, env)
        )


@contextmanager
def film(
    path: Path, speed: float = 10.0, size: int = 960, draw_over: DrawOver | None = None
) -> Iterator[Film]:
    """Film a run into an mp4 (H.264).

    Parameters
    ----------
    path : Path
        The mp4 file; it appears when the film is finished, also where the run was interrupted.
    speed : float
        Simulated seconds per second of the film, above 0.
    size : int
        Longer side of the floor in a frame [pixels].
    draw_over : callable or None
        As of ``Film``.

    Raises
    ------
    ValueError
        Where the speed is not positive.
    """
    check_speed(speed)
    with film_writer(path) as writer:
        yield Film(writer, speed / FRAMES_PER_SECOND, size, draw_over)


@contextmanager
def film_writer(path: Path) -> Iterator[Any]:
    """Lend a writer of frames with ``append_data(frame)``.

    The film (mp4, H.264) appears when it is done, whole or not at all.
    """
    # Frames of one size throughout: no rescaling to multiples of 16, the frames' sides are even.
    options: dict[str, Any] = {
        "fps": FRAMES_PER_SECOND,
        "codec": "libx264",
        "quality": 7,
        "macro_block_size": 2,
        "output_params": ["-preset", "veryfast"],
    }
    with whole_file(path) as beside:
        with imageio.get_writer(str(beside), **options) as writer:
            yield writer
        _check_whole(beside, path)


def _check_whole(film: Path, path: Path) -> None:
    """Check that a film has its table of contents, which comes last.

    The program that writes it says nothing where the disk is full.
    """
    if not film.exists() or b"moov" not in film.read_bytes():
        raise OSError(
            errno.EIO, "the film is not whole; is the disk full, or were there no frames?", str(path)
        )


def check_speed(speed: float) -> None:
    """Check the speed of a film, simulated seconds per second.

    Raises
    ------
    ValueError
        Where it is not positive.
    """
    if not 0.0 < speed < float("inf"):
        raise ValueError(f"speed of the film is {speed}; want more than 0 simulated seconds per second")
