"""Writes frames to a film as they are made.

A film is there whole or not at all. No frame is kept: FFmpeg takes each as it comes.
"""

import errno
import subprocess
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import Frame
from lidarium.evaluation.drawing.films.formats import FilmFormat, FilmSettings, format_of
from lidarium.evaluation.episodes.output import whole_file

_LOSSLESS = FilmFormat(
    "libx264rgb", "rgb24", ("-qp", "0", "-preset", "ultrafast"), 0, 0.0, lambda content: bool(content)
)
"""What frames are kept as, on the disk, until the palette of all of them is known."""

_BROKEN = "the film is not whole; is the disk full, or were there no frames?"


class FilmWriter:
    """Encodes frames, each as it comes.

    Parameters
    ----------
    path : Path
        The file.
    encoded : FilmFormat
        How they are encoded.
    rate : float
        Frames per second.
    width : int
        Wider frames are made as narrow as this [pixels].
    """

    def __init__(self, path: Path, encoded: FilmFormat, rate: float, width: int) -> None:
        self._path, self._encoded, self._width = path, encoded, width
        self._encoder: Generator[None, NDArray[np.uint8] | None, None] | None = None
        self.rate, self.frames = rate, 0

    @property
    def seconds(self) -> float:
        """How long the film is so far [s]."""
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
def film_writer(path: Path, settings: FilmSettings | None = None) -> Iterator[FilmWriter]:
    """Lend a writer of frames.

    The film appears when it is done, whole or not at all.

    Parameters
    ----------
    path : Path
        The film; the ending says what it is, as `FORMATS` lists them.
    settings : FilmSettings or None
        How wide and fast it is.

    Raises
    ------
    ValueError
        Where films do not end so.
    OSError
        Where it cannot be written whole, or has no frame.
    """
    path, settings = Path(path), settings or FilmSettings()
    final, rate, width = format_of(path), settings.rate_of(path), settings.width_of(path)
    with whole_file(path) as beside:
        first = beside.with_name("frames.mkv") if final.has_palette else beside
        writer = FilmWriter(first, _LOSSLESS if final.has_palette else final, rate, width)
        try:
            yield writer
        finally:
            writer.close()
        is_encoded = not final.has_palette or _write_with_palette(first, beside, final)
        if not is_encoded or not beside.exists() or not final.is_whole(beside.read_bytes()):
            raise OSError(errno.EIO, _BROKEN, str(path))


def _write_with_palette(frames: Path, film: Path, encoded: FilmFormat) -> bool:
    """Write frames in the 256 colours that suit all; return whether it was done.

    FFmpeg then writes of each frame what has changed since the one before.
    """
    if not frames.exists():
        return False
    palette = frames.with_name("palette.png")
    colours = ("-lavfi", "paletteuse=dither=none:diff_mode=rectangle", *encoded.parameters)
    return _is_done("-i", frames, "-vf", "palettegen", palette) and _is_done(
        "-i", frames, "-i", palette, *colours, film
    )


def _is_done(*arguments: str | Path) -> bool:
    """Run FFmpeg; return whether it did what it was asked for.

    It is in a group of its own: Ctrl-C is for us, who then end it.
    """
    words = [str(word.absolute()) if isinstance(word, Path) else word for word in arguments]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "quiet", *words]
    done = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False, process_group=0
    )
    return done.returncode == 0
