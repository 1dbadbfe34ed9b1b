"""Options of commands that make films."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

if TYPE_CHECKING:
    from lidarium.evaluation.drawing.films.formats import FilmSettings


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """How films are made."""

    film_speed: Annotated[float, arg(aliases=["--video-speed"])] = 10.0
    """simulated seconds per second of a film"""
    film_width: int | None = None
    """most pixels that a film is wide; 980 of an mp4, 640 of a GIF and a WebP where left out"""
    film_fps: float | None = None
    """frames per second of a film; 20 of an mp4, 10 of a GIF and a WebP where left out"""

    @property
    def film_settings(self) -> "FilmSettings":
        """What the options say.

        Raises
        ------
        ValueError
            Where one is out of range.
        """
        from lidarium.evaluation.drawing.films.formats import FilmSettings

        return FilmSettings(self.film_speed, self.film_width, self.film_fps)


@dataclass(frozen=True, kw_only=True)
class FilmFiles(FilmOptions):
    """Where films of records are written to."""

    gif: Path | None = None
    """write a film as an animated picture; its name ends in .gif or .webp"""
    video: Path | None = None
    """write a film as a video; its name ends in .mp4"""

    @property
    def films(self) -> list[Path]:
        """The films that are asked for."""
        return [path for path in (self.gif, self.video) if path is not None]

    def check_films(self) -> None:
        """Check that the films can be made, before anything is written.

        Raises
        ------
        ValueError
            Where a name has no ending of a film, or an option is out of range.
        OSError
            Where nothing can be written to a folder.
        """
        from lidarium.evaluation.drawing.films.formats import format_of
        from lidarium.evaluation.episodes.output import check_writable

        for path in self.films:
            check_writable(path.parent)
            format_of(path)
            if path.is_dir():
                raise IsADirectoryError(f"cannot write to {path}: it is a folder; want a new name")
        assert self.film_settings
