"""Parts of frames, drawn from plain arrays.

They are the part of a floor that is seen, paths, robots and a header.
"""

import colorsys
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.people.crowd import Crowd

Frame = NDArray[np.uint8]
Colour = tuple[int, int, int]
Cell = TypeVar("Cell", np.uint8, np.float32)

SIZE = 960
"""Longer side of the floor in a frame by default [pixels]."""

RECENT_S = 60.0
"""Time for which a robot's path is drawn [s]."""

INK: Colour = (31, 41, 55)
FAINT_INK: Colour = (107, 114, 128)
BACKGROUND: Colour = (182, 190, 201)
UNEXPLORED: Colour = (214, 220, 229)
NOT_COUNTED: Colour = (236, 240, 245)
EXPLORED: Colour = (255, 255, 255)
WALL: Colour = (38, 50, 66)
PERSON: Colour = (75, 85, 99)
DOOR: Colour = (146, 84, 34)

_TEAM: tuple[Colour, ...] = (
    (37, 99, 235),
    (234, 88, 12),
    (22, 163, 74),
    (192, 38, 211),
    (8, 145, 178),
    (202, 138, 4),
    (225, 29, 72),
    (101, 78, 163),
)
_MARGIN = 0.25
SHIFT = 4
"""Fractional bits of OpenCV's coordinates."""

BORDER = 10

LEAST_WIDTH = 360
"""Minimum width of a frame with a header [pixels]."""


def team_colours(robots: int) -> list[Colour]:
    """Return a colour (red, green, blue) for each robot.

    The first eight are far apart, the others evenly around the circle.
    """
    colours = list(_TEAM[:robots])
    for k in range(len(colours), robots):
        red, green, blue = colorsys.hsv_to_rgb((k * 0.618034) % 1.0, 0.75, 0.75)
        colours.append((round(red * 255), round(green * 255), round(blue * 255)))
    return colours


@dataclass(frozen=True, slots=True)
class View:
    """The part of a raster that a frame shows, and its scale.

    Attributes
    ----------
    rows, columns : slice
        Cells of the raster.
    origin : (x, y)
        Lower left corner of those cells [m].
    scale : float
        Pixels per metre.
    height, width : int
        Size of the picture [pixels].
    block : int
        Side of the blocks of cells that are drawn as one, if there are more cells than pixels.
    """

    rows: slice
    columns: slice
    origin: tuple[float, float]
    scale: float
    height: int
    width: int
    block: int

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return points (..., 2) as x, y [m] in OpenCV's pixels.

        The pixels have `SHIFT` fractional bits.
        """
        x = (points[..., 0] - self.origin[0]) * self.scale - 0.5
        y = self.height - (points[..., 1] - self.origin[1]) * self.scale - 0.5
        return np.rint(np.stack([x, y], axis=-1) * (1 << SHIFT)).astype(np.int32)


def view_around(shown: NDArray[np.bool_], origin: tuple[float, float], resolution: float, size: int) -> View:
    """Return the view on the cells of a grid that should be shown.

    It has a margin, and its longer side is ``size`` pixels.

    Parameters
    ----------
    shown : (rows, columns) bool
        Cells that must be visible.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m].
    resolution : float
        Side of a cell [m].
    """
    rows, columns = (_span(np.asarray(shown.any(axis=axis)), math.ceil(_MARGIN / resolution)) for axis in (1, 0))
    tall, wide = ((span.stop - span.start) * resolution for span in (rows, columns))
    scale = size / max(tall, wide)
    corner = (origin[0] + columns.start * resolution, origin[1] + rows.start * resolution)
    block = max(max(rows.stop - rows.start, columns.stop - columns.start) // size, 1)
    return View(rows, columns, corner, scale, max(round(tall * scale), 1), max(round(wide * scale), 1), block)


def _span(is_used: NDArray[np.bool_], margin: int) -> slice:
    used = np.flatnonzero(is_used)
    low, high = (int(used[0]), int(used[-1]) + 1) if used.size else (0, len(is_used))
    return slice(max(low - margin, 0), min(high + margin, len(is_used)))


def blocks_of(levels: NDArray[np.uint8], view: View) -> NDArray[np.uint8]:
    """Return a map's three levels with blocks of cells as one.

    This is used if there are more cells than pixels; occupied cells show.
    """
    if view.block == 1:
        return levels
    rows, columns = (side // view.block for side in levels.shape)
    whole = levels[: rows * view.block, : columns * view.block]
    # Along rows first: a whole row of cells at a time.
    lowest = whole.reshape(rows, view.block, columns * view.block).min(axis=1)
    return np.asarray(lowest.reshape(rows, columns, view.block).min(axis=2))


def thinned(cells: NDArray[Cell], block: int) -> NDArray[Cell]:
    """Return the first cell of each block of ``block`` x ``block`` cells."""
    rows, columns = (side // block * block for side in cells.shape)
    return cells[:rows:block, :columns:block]


def enlarged(picture: Frame, view: View) -> Frame:
    """Return a picture of a view's cells, as large as the view.

    It may be of blocks of cells; row 0 is at the lowest y, and the picture is upright.
    """
    interpolation = cv2.INTER_NEAREST if view.height >= picture.shape[0] else cv2.INTER_AREA
    return np.ascontiguousarray(
        cv2.resize(picture, (view.width, view.height), interpolation=interpolation)[::-1], dtype=np.uint8
    )


def draw_paths(frame: Frame, view: View, ways: NDArray[np.float64], colours: Sequence[Colour]) -> None:
    """Draw the paths of robots, positions (times, robots, 2) [m]."""
    thickness = max(round(0.04 * view.scale), 2)
    for robot, colour in enumerate(colours):
        cv2.polylines(frame, [view.pixels(ways[:, robot])], False, colour, thickness, cv2.LINE_AA, SHIFT)


def draw_robots(
    frame: Frame,
    view: View,
    poses: NDArray[np.float64],
    radius: float | Sequence[float],
    has_ended: Sequence[bool],
    colours: Sequence[Colour],
) -> None:
    """Draw robots of a radius, or of one each [m], with their headings.

    Poses are (robots, 3) [m, rad]; robots that have ended are paler.
    """
    fixed = 1 << SHIFT
    radii = np.broadcast_to(radius, len(poses))
    for (x, y, theta), size, colour, is_over in zip(poses, radii, colours, has_ended, strict=True):
        shown = max(float(size) * view.scale, 6.0)
        ahead = np.array([math.cos(theta), math.sin(theta)]) * (shown / view.scale)
        centre, tip = view.pixels(np.stack([(x, y), (x + ahead[0], y + ahead[1])]))
        place = (int(centre[0]), int(centre[1]))
        cv2.circle(frame, place, round((shown + 1.5) * fixed), EXPLORED, -1, cv2.LINE_AA, SHIFT)
        cv2.circle(frame, place, round(shown * fixed), _paler(colour) if is_over else colour, -1, cv2.LINE_AA, SHIFT)
        cv2.line(frame, place, (int(tip[0]), int(tip[1])), EXPLORED, max(round(shown / 4), 1), cv2.LINE_AA, SHIFT)


def draw_crowd(frame: Frame, view: View, crowd: Crowd | None) -> None:
    """Draw people as discs with a light rim, and the leaves of doors as lines; None draws nothing."""
    if crowd is None:
        return
    thickness = max(round(0.07 * view.scale), 2)
    for x, y, to_x, to_y in crowd.leaves[crowd.opened < 1.0]:
        here, there = view.pixels(np.array([(x, y), (to_x, to_y)])).tolist()
        cv2.line(frame, here, there, DOOR, thickness, cv2.LINE_AA, SHIFT)
    for x, y, radius in crowd.people:
        shown, place = max(float(radius) * view.scale, 4.0), view.pixels(np.array([(x, y)]))[0].tolist()
        cv2.circle(frame, place, round((shown + 1.5) * (1 << SHIFT)), EXPLORED, -1, cv2.LINE_AA, SHIFT)
        cv2.circle(frame, place, round(shown * (1 << SHIFT)), PERSON, -1, cv2.LINE_AA, SHIFT)


def pale(colour: Colour) -> Colour:
    """Return a colour mixed with white, for free cells on the map of a robot of this colour."""
    red, green, blue = ((channel + 2 * 255) // 3 for channel in colour)
    return red, green, blue


def _paler(colour: Colour) -> Colour:
    red, green, blue = (channel + (220 - channel) // 2 for channel in colour)
    return red, green, blue


def with_header(picture: Frame, name: str, coverage: float, time_s: float) -> Frame:
    """Return a picture in a frame below a line of text and a bar of coverage.

    Both sides are even, as `even` has it.
    """
    width = max(picture.shape[1] + 2 * BORDER, LEAST_WIDTH)
    return even(np.concatenate([_header(name, coverage, time_s, width), _framed(picture, width)]))


def _header(name: str, share: float, time_s: float, width: int) -> Frame:
    """Draw a line of text over a bar of coverage."""
    scale = min(max(width / 960.0, 0.45), 1.0)
    height = round(44 * scale) + 8
    header = np.full((height, width, 3), 255, np.uint8)
    name = _plain(name)
    baseline, margin = round(29 * scale), round(12 * scale)
    right = f"{100.0 * share:.1f} % explored    {time_s:.1f} s"
    _put(header, right, (width - margin - _text_width(right, 0.72 * scale), baseline), INK, 0.72 * scale)
    room = width - 3 * margin - _text_width(right, 0.72 * scale)
    while name and _text_width(name, 0.6 * scale) > room:
        name = name[:-1]
    _put(header, name, (margin, baseline), FAINT_INK, 0.6 * scale)
    draw_bar(header[-6:], share)
    return header


def line_of_text(words: str, size: tuple[int, int], colour: Colour, background: Colour, right: str = "") -> Frame:
    """Return a line of words, and others at its right end.

    It has as many letters of the first as there is room for. The size is (width, height) [pixels].
    """
    width, height = size
    line = np.full((height, width, 3), background, np.uint8)
    words, scale, margin, baseline = _plain(words), height / 51.0, height // 3, round(0.71 * height)
    right_width = _text_width(right, scale) + margin if right else 0
    while words and _text_width(words, scale) > width - 2 * margin - right_width:
        words = words[:-1]
    _put(line, words.rstrip(), (margin, baseline), colour, scale)
    _put(line, right, (width - right_width, baseline), colour, scale)
    return line


def draw_bar(line: Frame, share: float) -> None:
    """Draw a bar of coverage over all of a line."""
    line[:] = UNEXPLORED
    line[:, : round(line.shape[1] * min(share, 1.0))] = (22, 163, 74)


def _plain(text: str) -> str:
    """Keep the characters that OpenCV's fonts can write."""
    return text.encode("ascii", "replace").decode()


def _text_width(text: str, scale: float) -> int:
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0])


def _put(picture: Frame, text: str, place: tuple[int, int], colour: Colour, scale: float) -> None:
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)


def _framed(picture: Frame, width: int) -> Frame:
    left = (width - picture.shape[1]) // 2
    right = width - picture.shape[1] - left
    return np.asarray(
        cv2.copyMakeBorder(picture, BORDER, BORDER, left, right, cv2.BORDER_CONSTANT, value=BACKGROUND),
        np.uint8,
    )


def even(picture: Frame) -> Frame:
    """Return a picture both sides of which are even, as video codecs want them."""
    rows, columns = picture.shape[0] % 2, picture.shape[1] % 2
    return np.asarray(cv2.copyMakeBorder(picture, 0, rows, 0, columns, cv2.BORDER_CONSTANT, value=BACKGROUND), np.uint8)
