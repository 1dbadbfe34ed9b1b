"""Films of records: of one, or of several side by side in step.

Any version can film them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarium.envs.drawing.frame_parts import (
    BACKGROUND,
    BORDER,
    EXPLORED,
    INK,
    LEAST_WIDTH,
    Frame,
    draw_bar,
    even,
    line_of_text,
)
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.drawing.films import LAST_FRAME_S, FilmSettings, film_writer
from lidarium.evaluation.drawing.record_frames import TrackFrames, known_at_end
from lidarium.evaluation.record.episode_record import EpisodeRecord

MOST_SIDE_BY_SIDE = 9
"""Maximum number of records of one film."""

GAP, LINE, BAR, TITLE = 6, 26, 6, 38
"""Between tiles; height of the line above a tile, of its bar, and of the line above all [pixels]."""


def save_track_film(
    path: Path,
    record: EpisodeRecord,
    settings: FilmSettings | None = None,
    floor: Floor | None = None,
    predicts: bool = False,
) -> None:
    """Film a record (mp4, GIF or WebP by the ending of the name)."""
    settings = settings or FilmSettings()
    frames = TrackFrames(record, settings.width_of(path) - 2 * BORDER, floor, predicts=predicts)
    _write(path, frames.draw, _end_of(record), settings)


def save_side_by_side(
    path: Path, records: Mapping[str, EpisodeRecord], title: str, settings: FilmSettings | None = None
) -> None:
    """Film several records in step; one that has ended shows its end."""
    if not 1 <= len(records) <= MOST_SIDE_BY_SIDE:
        raise ValueError(f"the film shows {len(records)} episodes; want 1 to {MOST_SIDE_BY_SIDE}")
    settings = settings or FilmSettings()
    columns = _columns(len(records))
    if settings.width is None:
        readable = columns * LEAST_WIDTH + (columns - 1) * GAP
        settings = replace(settings, width=max(settings.width_of(path), readable))
    tiles = _Tiles(records, title, settings.width_of(path), columns)
    _write(path, tiles.draw, max(map(_end_of, records.values())), settings)


class _Tiles:
    """Draws records side by side, below a line of text."""

    def __init__(self, records: Mapping[str, EpisodeRecord], title: str, width: int, columns: int) -> None:
        self._title, self._columns, self._records = title, columns, records
        self._tile = (width - GAP * (columns - 1)) // columns // 2 * 2
        known = [known_at_end(record) for record in records.values()]
        grids = {
            (each.shape, *record.display.origin, record.display.resolution)
            for each, record in zip(known, records.values(), strict=True)
        }
        # Maps of one grid have a common extent: all have room for the area that one has seen.
        shown = np.logical_or.reduce(known) if len(grids) == 1 else None
        self._frames = [TrackFrames(record, self._tile, shown=shown) for record in records.values()]

    def draw(self, time_s: float) -> Frame:
        """Return the frame at a time [s]."""
        drawn = [
            self._draw_tile(name, record, frames, min(time_s, _end_of(record)))
            for (name, record), frames in zip(self._records.items(), self._frames, strict=True)
        ]
        height, width = max(len(each) for each in drawn), self._tile
        rows, whole_width = -(-len(drawn) // self._columns), self._columns * (width + GAP) - GAP
        picture = np.full((TITLE + rows * (height + GAP) - GAP, whole_width, 3), BACKGROUND, np.uint8)
        picture[:TITLE] = line_of_text(self._title, (whole_width, TITLE), INK, EXPLORED)
        for place, each in enumerate(drawn):
            row, column = divmod(place, self._columns)
            top, left = TITLE + row * (height + GAP), column * (width + GAP)
            picture[top : top + len(each), left : left + width] = each
        return even(picture)

    def _draw_tile(self, name: str, record: EpisodeRecord, frames: TrackFrames, time_s: float) -> Frame:
        coverage, drawn = record.display.coverage_at(time_s), frames.picture(time_s)
        tile = np.full((LINE + BAR + len(drawn), self._tile, 3), BACKGROUND, np.uint8)
        right = f"{100.0 * coverage:.1f} %   {time_s:.1f} s"
        tile[:LINE] = line_of_text(name, (self._tile, LINE), EXPLORED, INK, right)
        draw_bar(tile[LINE : LINE + BAR], coverage)
        left = (self._tile - drawn.shape[1]) // 2
        tile[LINE + BAR :, left : left + drawn.shape[1]] = drawn
        return tile


def _columns(count: int) -> int:
    """Return the columns of that many tiles: three at most, two of four tiles."""
    return min(count, 2 if count == 4 else 3)


def _end_of(record: EpisodeRecord) -> float:
    return float(record.display.times[-1])


def _write(path: Path, draw: Callable[[float], Frame], end_s: float, settings: FilmSettings) -> None:
    """Write frames at equal simulated time; the last one is held for a moment."""
    with film_writer(path, settings) as writer:
        for frame in range(math.ceil(end_s * writer.rate / settings.speed)):
            writer.append_data(draw(frame * settings.speed / writer.rate))
        writer.hold(draw(end_s), LAST_FRAME_S)
