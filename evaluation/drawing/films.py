"""Films of runs: their content, and how frames become a file.

A film of a run is an entry of the registry ``film``, which draws its frames. The ending of a film's name is
its format. A film exists completely or not at all, and FFmpeg takes each frame as it comes.
"""

import errno
import math
import subprocess
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Policy
from lidarium.envs.drawing.frame_parts import BORDER, Frame, even
from lidarium.envs.drawing.prediction_layer import PredictionLayer
from lidarium.envs.drawing.rendering import Scene, draw_frame
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.drawing.supervision_marks import recent_supervision
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.mapping.files.output import whole_file
from lidarium.registry import Registry

MOST_FRAMES_PER_SECOND = 50.0
"""No GIF is faster: viewers slow down faster ones."""

WIDTHS = 120, 4096
"""Minimum and maximum width of a film [pixels]."""

_LOOP = ("-loop", "0")


@dataclass(frozen=True, slots=True)
class _FilmFormat:
    """Encoding of a film.

    Attributes
    ----------
    codec, pixel_format : str
        FFmpeg's names.
    parameters : tuple of str
        Further arguments of FFmpeg.
    width : int
        Maximum width of a frame by default [pixels].
    frames_per_second : float
        Default frame rate [1/s].
    is_whole : callable
        Takes the content of a file, and returns whether its end was written.
    has_palette : bool
        Whether all frames share 256 colours, which are known when all frames are.
    """

    codec: str
    pixel_format: str
    parameters: tuple[str, ...]
    width: int
    frames_per_second: float
    is_whole: Callable[[bytes], bool]
    has_palette: bool = False


def _is_whole_webp(content: bytes) -> bool:
    return content[:4] == b"RIFF" and int.from_bytes(content[4:8], "little") + 8 == len(content)


FORMATS = {
    # The table of contents of an mp4 comes last.
    ".mp4": _FilmFormat(
        "libx264",
        "yuv420p",
        ("-crf", "15", "-preset", "veryfast"),
        960 + 2 * BORDER,
        20.0,
        lambda content: b"moov" in content,
    ),
    ".gif": _FilmFormat("gif", "pal8", _LOOP, 640, 10.0, lambda content: content.endswith(b";"), has_palette=True),
    # Without loss: frames are drawn in few colours, which takes less than a lossy file and is sharp.
    ".webp": _FilmFormat(
        "libwebp_anim",
        "bgra",
        ("-lossless", "1", "-compression_level", "3", *_LOOP),
        640,
        10.0,
        _is_whole_webp,
    ),
}
"""Formats by the ending of a film's name."""


def format_of(path: Path) -> _FilmFormat:
    """Return the format for the suffix of a film's name."""
    found = FORMATS.get(Path(path).suffix.lower())
    if found is None:
        raise ValueError(f"the film {path} has no ending of a film; want one of {', '.join(FORMATS)}")
    return found


@dataclass(frozen=True, slots=True)
class FilmSettings:
    """Parameters of a film; checks itself.

    Attributes
    ----------
    speed : float, default 10.0
        Simulated seconds per second of the film, above 0.
    width : int or None
        Maximum width of a frame [pixels]; by default (None) that of the format.
    frames_per_second : float or None
        Frames per second of the film; by default (None) those of the format.
    """

    speed: float = 10.0
    width: int | None = None
    frames_per_second: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < float("inf"):
            raise ValueError(f"speed of the film is {self.speed}; want more than 0 simulated seconds per second")
        least, most = WIDTHS
        if self.width is not None and not least <= self.width <= most:
            raise ValueError(f"width of the film is {self.width} pixels; want {least} to {most}")
        rate = self.frames_per_second
        if rate is not None and not 0.0 < rate <= MOST_FRAMES_PER_SECOND:
            raise ValueError(
                f"the film has {rate} frames per second; want more than 0, up to {MOST_FRAMES_PER_SECOND:.0f}"
            )

    def width_of(self, path: Path) -> int:
        """Return the most pixels that frames of a film of this name are wide."""
        return self.width or format_of(path).width

    def rate_of(self, path: Path) -> float:
        """Return the frames per second of a film of this name."""
        return self.frames_per_second or format_of(path).frames_per_second


_LOSSLESS = _FilmFormat(
    "libx264rgb", "rgb24", ("-qp", "0", "-preset", "ultrafast"), 0, 0.0, lambda content: bool(content)
)
"""Format of the frames on the disk until the palette of all frames is known."""

_BROKEN = "the film is not whole; is the disk full, or were there no frames?"


class _FilmWriter:
    """Encodes frames, each as it comes."""

    def __init__(self, path: Path, encoded: _FilmFormat, rate: float, width: int) -> None:
        self._path, self._encoded, self._width = path, encoded, width
        self._encoder: Generator[None, NDArray[np.uint8] | None, None] | None = None
        self.rate, self.frames = rate, 0

    @property
    def seconds(self) -> float:
        """Length of the film so far [s]."""
        return self.frames / self.rate

    def append_data(self, frame: Frame) -> None:
        """Add a frame (rows, columns, 3), of the same size as all others."""
        if self._encoder is None:
            self._encoder = self._begin(frame)
        try:
            self._encoder.send(np.ascontiguousarray(frame, np.uint8))
        except OSError as error:  # its message is FFmpeg's command line
            raise OSError(errno.EIO, _BROKEN) from error
        self.frames += 1

    def hold(self, frame: Frame, seconds: float) -> None:
        """Show a frame for some time [s]."""
        for _ in range(round(seconds * self.rate)):
            self.append_data(frame)

    def close(self) -> None:
        """End the file."""
        if self._encoder is not None:
            self._encoder.close()

    def _begin(self, frame: Frame) -> Generator[None, NDArray[np.uint8] | None, None]:
        height, width = frame.shape[:2]
        # Both sides even, as video codecs want them.
        narrower = ["-vf", f"scale={self._width // 2 * 2}:-2:flags=area"] if width > self._width else []
        # A name with a colon would be a protocol, were the path not absolute.
        encoder: Generator[None, NDArray[np.uint8] | None, None] = imageio_ffmpeg.write_frames(
            str(self._path.absolute()),
            (width, height),
            fps=self.rate,
            codec=self._encoded.codec,
            pix_fmt_out=self._encoded.pixel_format,
            quality=None,
            macro_block_size=1,
            ffmpeg_log_level="quiet",
            output_params=[*self._encoded.parameters, *narrower],
        )
        encoder.send(None)
        return encoder


@contextmanager
def film_writer(path: Path, settings: FilmSettings | None = None) -> Iterator[_FilmWriter]:
    """Lend a writer of frames.

    The film appears when it is done, whole or not at all.
    """
    path, settings = Path(path), settings or FilmSettings()
    final, rate, width = format_of(path), settings.rate_of(path), settings.width_of(path)
    with whole_file(path) as beside:
        first = beside.with_name("frames.mkv") if final.has_palette else beside
        writer = _FilmWriter(first, _LOSSLESS if final.has_palette else final, rate, width)
        try:
            yield writer
        finally:
            writer.close()
        is_encoded = not final.has_palette or _write_with_palette(first, beside, final)
        if not is_encoded or not beside.exists() or not final.is_whole(beside.read_bytes()):
            raise OSError(errno.EIO, _BROKEN, str(path))


def _write_with_palette(frames: Path, film: Path, encoded: _FilmFormat) -> bool:
    """Write frames in the 256 colours that suit all; return whether it was done.

    FFmpeg then writes only the changes from frame to frame.
    """
    if not frames.exists():
        return False
    palette = frames.with_name("palette.png")
    colours = ("-lavfi", "paletteuse=dither=none:diff_mode=rectangle", *encoded.parameters)
    return _is_done("-i", frames, "-vf", "palettegen", palette) and _is_done(
        "-i", frames, "-i", palette, *colours, film
    )


def _is_done(*arguments: str | Path) -> bool:
    """Run FFmpeg; return whether it succeeded.

    It runs in a group of its own: Ctrl-C reaches only this process, which then ends it.
    """
    words = [str(word.absolute()) if isinstance(word, Path) else word for word in arguments]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "quiet", *words]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False, process_group=0)
    return done.returncode == 0


HELD_S, LAST_FRAME_S = 1.8, 1.5
"""Duration of a held moment, and of the last picture [s]."""


class _Frames(Protocol):
    """Draws an episode as it runs.

    A class of frames is made with the policy and the width of a film [pixels]. Optional methods are
    ``happens(env)``, which is True if something has happened since the last frame that the film holds for a
    moment, and a static method ``check(settings)``, which raises a ValueError if it cannot show such a team.
    """

    def draw(self, env: ExplorationEnv) -> Frame:
        """Return the frame of this moment, (rows, columns, 3) uint8 RGB, always of the same size."""


FramesMaker = Callable[[Policy, int], _Frames] | Callable[[ExplorationEnv, int], Frame]

FILMS: Registry[FramesMaker] = Registry("film")
"""Films of runs by name: a class of frames, or a function that returns a frame."""

FILMS.register(
    "maps",
    "lidarium.evaluation.drawing.map_film:MapFrames",
    "the map of each robot, and how maps are joined if starts are unknown",
)
FILMS.register(
    "prediction",
    "lidarium.evaluation.drawing.films:PredictionFrames",
    "like `scans`, plus what a network predicts beyond the explored part",
)
FILMS.register(
    "scans",
    "lidarium.evaluation.drawing.films:ScanFrames",
    "what is explored, the robots, and what their lasers see",
)


def film(name: str, summary: str) -> Callable[[FramesMaker], FramesMaker]:
    """Register a film of runs, for ``lidarium run --film-shows NAME``.

    The item is a function of an environment and a width [pixels] that returns a frame, (rows, columns, 3)
    uint8 RGB; or a class of such frames, made with the policy and the width, with a method ``draw(env)``.

    Parameters
    ----------
    name : str
        Its name; no other film has it.
    summary : str
        One line that describes it.

    Raises
    ------
    ValueError
        If the name is taken.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> @lidarium.film("dark", "a frame that darkens as the floor is explored")
    ... def dark(env, width):
    ...     return np.full((width // 2, width, 3), int(255 * (1 - env.scorer.coverage)), np.uint8)
    """

    def register(item: FramesMaker) -> FramesMaker:
        FILMS.register(name, item, summary)
        return item

    return register


def frames_of(name: str, policy: Policy, width: int) -> _Frames:
    """Return the frames of a film by name; a ValueError if the name is unknown."""
    item: Any = FILMS[name]
    return item(policy, width) if isinstance(item, type) else _DrawnFrames(item, width)


class _DrawnFrames:
    """Frames that a function draws."""

    def __init__(self, function: Callable[[ExplorationEnv, int], Frame], width: int) -> None:
        self._function, self._width = function, width

    def draw(self, env: ExplorationEnv) -> Frame:
        return self._function(env, self._width)


class ScanFrames:
    """The floor, its explored part, the robots, their scans, and recent decisions of a station."""

    def __init__(self, policy: Policy, width: int) -> None:
        self._size, self._draw_over = width - 2 * BORDER, recent_supervision(policy)

    def draw(self, env: ExplorationEnv) -> Frame:
        """Return the frame of this moment."""
        over = None if self._draw_over is None else partial(self._draw_over, env)
        return draw_frame(self._scene(env), self._size, over)

    def _scene(self, env: ExplorationEnv) -> Scene:
        return env.scene()


class PredictionFrames(ScanFrames):
    """The same, with what the network predicts, whoever explores."""

    def __init__(self, policy: Policy, width: int) -> None:
        super().__init__(policy, width)
        self._prediction = PredictionLayer()

    def _scene(self, env: ExplorationEnv) -> Scene:
        return replace(env.scene(), prediction=self._prediction)


class Film(Watcher):
    """Takes frames of an environment at equal simulated time; a ``Watcher``."""

    def __init__(self, writer: _FilmWriter, frames: _Frames, speed: float) -> None:
        self.writer, self._frames = writer, frames
        self._period_s, self._taken = speed / writer.rate, 0

    def begin(self, env: ExplorationEnv) -> None:
        """Take the first frame."""
        self._take(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64]) -> None:
        """Take a frame if it is time for one."""
        self._take(env)

    def _take(self, env: ExplorationEnv) -> None:
        due = math.floor((env.scorer.time + 1e-9) / self._period_s) + 1 - self._taken
        self._taken += due
        happens = getattr(self._frames, "happens", None)
        if happens is not None and happens(env):
            self.writer.hold(self._draw(env), HELD_S)
        elif due:
            # Several frames if the film is slower than the time steps.
            self.writer.hold(self._draw(env), due / self.writer.rate)

    def end(self, env: ExplorationEnv) -> None:
        """Hold the last picture for a moment."""
        self.writer.hold(self._draw(env), LAST_FRAME_S)

    def _draw(self, env: ExplorationEnv) -> Frame:
        frame = np.asarray(self._frames.draw(env))
        if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8:
            raise ValueError(
                f"a frame of the film is {frame.dtype} of shape {frame.shape}; want uint8 (rows, columns, 3)"
            )
        return frame if frame.shape[0] % 2 == frame.shape[1] % 2 == 0 else even(frame)


@contextmanager
def filmed(path: Path, frames: _Frames, settings: FilmSettings | None = None) -> Iterator[Film]:
    """Film a run."""
    settings = settings or FilmSettings()
    with film_writer(path, settings) as writer:
        yield Film(writer, frames, settings.speed)
