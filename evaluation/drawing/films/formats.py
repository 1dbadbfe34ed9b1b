"""Files that films are written as, and how a film is made.

The ending of a film's name says which file it is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from lidarium.envs.drawing.frame_parts import BORDER

MOST_FRAMES_PER_SECOND = 50.0
"""No GIF is faster: viewers show what is faster slowly."""

WIDTHS = 120, 4096
"""Least and greatest width of a film [pixels]."""

_LOOP = ("-loop", "0")


@dataclass(frozen=True, slots=True)
class FilmFormat:
    """How a film is encoded.

    Attributes
    ----------
    codec, pixel_format : str
        FFmpeg's names.
    parameters : tuple of str
        More of what FFmpeg is asked for.
    width : int
        Most pixels that a frame is wide, where nothing is said.
    frames_per_second : float
        Where nothing is said.
    is_whole : callable
        Takes the content of a file, and says whether its end was written.
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
    ".mp4": FilmFormat(
        "libx264",
        "yuv420p",
        ("-crf", "15", "-preset", "veryfast"),
        960 + 2 * BORDER,
        20.0,
        lambda content: b"moov" in content,
    ),
    ".gif": FilmFormat(
        "gif", "pal8", _LOOP, 640, 10.0, lambda content: content.endswith(b";"), has_palette=True
    ),
    # Without loss: frames are drawn in few colours, which takes less than a lossy file and is sharp.
    ".webp": FilmFormat(
        "libwebp_anim",
        "bgra",
        ("-lossless", "1", "-compression_level", "3", *_LOOP),
        640,
        10.0,
        _is_whole_webp,
    ),
}
"""What a film can be, by the ending of its name."""


def format_of(path: Path) -> FilmFormat:
    """Return the format that the ending of a film's name stands for.

    Raises
    ------
    ValueError
        Where films do not end so.
    """
    found = FORMATS.get(Path(path).suffix.lower())
    if found is None:
        raise ValueError(f"the film {path} has no ending of a film; want one of {', '.join(FORMATS)}")
    return found


@dataclass(frozen=True, slots=True)
class FilmSettings:
    """How a film is made; checks itself.

    Attributes
    ----------
    speed : float
        Simulated seconds per second of the film, above 0.
    width : int or None
        Most pixels that a frame is wide; as the format has it where None.
    frames_per_second : float or None
        As the format has it where None.

    Raises
    ------
    ValueError
        Where one is out of range.
    """

    speed: float = 10.0
    width: int | None = None
    frames_per_second: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < float("inf"):
            raise ValueError(
                f"speed of the film is {self.speed}; want more than 0 simulated seconds per second"
            )
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
