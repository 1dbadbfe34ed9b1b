"""Films of a run, made while it runs."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from lidarium.agents.policy import Policy
    from lidarium.evaluation.drawing.films.film import Film, Frames
    from lidarium.evaluation.drawing.films.formats import FilmSettings
    from lidarium.evaluation.episodes.watching import WatchedExploration

Shown = Literal["auto", "maps", "scans"]
"""What a film of a run shows."""


class RunFilms:
    """Films an episode into several files at once, or into none.

    Parameters
    ----------
    env : WatchedExploration
        Its watchers are the films, from `begin` to `end`.
    policy : Policy
        What drives the robots.
    names : sequence of str
        Of the files.
    shown : str
        ``maps``: what each robot knows, and how maps are joined. ``scans``: what is explored, and what lasers
        see. ``auto``: maps, where several robots do not know their starts and have no cameras.
    settings : FilmSettings
        How the films are made.

    Raises
    ------
    ValueError
        Where maps are to be shown of robots that know their starts.
    """

    def __init__(
        self,
        env: "WatchedExploration",
        policy: "Policy",
        names: Sequence[str],
        shown: Shown,
        settings: "FilmSettings",
    ) -> None:
        team = env.settings
        if names and shown == "maps" and team.known_starts:
            raise ValueError(
                "--film-shows is maps, but the robots know their starts and share one map; want scans, or "
                "--unknown-starts"
            )
        has_maps = not team.known_starts and team.robots > 1 and team.camera is None
        self._shows_maps = has_maps if shown == "auto" else shown == "maps"
        self._env, self._policy, self._names, self._settings = env, policy, names, settings
        self._open = ExitStack()
        self._films: list[Film] = []
        self._has_begun = False

    @property
    def seconds(self) -> float:
        """How long the longest film is so far [s]."""
        return max((made.writer.seconds for made in self._films), default=0.0)

    def begin(self, folder: Path) -> None:
        """Begin the films, unless they have begun; the policy has been reset."""
        if self._has_begun:
            return
        from lidarium.evaluation.drawing.films.film import film

        self._has_begun = True
        for path in (folder / name for name in self._names):
            frames = self._frames(self._settings.width_of(path))
            made = self._open.enter_context(film(path, frames, self._settings))
            made.begin(self._env)
            self._films.append(made)
        self._env.watchers += self._films

    def end(self) -> None:
        """Hold the last pictures for a moment."""
        for made in self._films:
            made.end(self._env)

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Write the films at the end, or none of them where that is an error."""
        with self._open:
            yield
            self._env.watchers[:] = [each for each in self._env.watchers if each not in self._films]

    def _frames(self, width: int) -> "Frames":
        if self._shows_maps:
            from lidarium.evaluation.drawing.films.map_frames import MapFrames

            return MapFrames(self._policy, width)
        from lidarium.evaluation.drawing.films.film import ScanFrames
        from lidarium.evaluation.drawing.supervision_marks import recent_supervision

        return ScanFrames(width, recent_supervision(self._policy))
