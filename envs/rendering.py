"""Frames: the floor from above, what is explored, the robots and what their lasers see."""

import colorsys
import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.coverage import unpack_bits
from lidarium.envs.scorer import TRACK_PERIOD_S
from lidarium.envs.simulation.floor_tables import FloorTables

if TYPE_CHECKING:
    from lidarium.envs.exploration import ExplorationEnv

Frame = NDArray[np.uint8]
Colour = tuple[int, int, int]

SIZE = 960
"""Longer side of the floor in a frame by default [pixels]."""

RECENT_S = 60.0
"""How far back a robot's path is drawn [s]."""

INK: Colour = (31, 41, 55)
FAINT_INK: Colour = (107, 114, 128)
BACKGROUND: Colour = (182, 190, 201)
UNEXPLORED: Colour = (214, 220, 229)
NOT_COUNTED: Colour = (236, 240, 245)
EXPLORED: Colour = (255, 255, 255)
WALL: Colour = (38, 50, 66)

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
_NEAR = 0.125
_SHIFT = 4
"""Fractional bits of OpenCV's coordinates."""

_BORDER = 10
_FAN_OPACITY = 0.22
_SOLID, _WALL, _UNEXPLORED, _NOT_COUNTED, _EXPLORED = range(5)
PALETTE = np.array([BACKGROUND, WALL, UNEXPLORED, NOT_COUNTED, EXPLORED], np.uint8)
"""Colours of what `classify` returns."""


def team_colours(robots: int) -> list[Colour]:
    """Return a colour (red, green, blue) for each robot; the first eight are far apart, the others evenly around the circle."""
    colours = list(_TEAM[:robots])
    for k in range(len(colours), robots):
        red, green, blue = colorsys.hsv_to_rgb((k * 0.618034) % 1.0, 0.75, 0.75)
        colours.append((round(red * 255), round(green * 255), round(blue * 255)))
    return colours


@dataclass(frozen=True, slots=True)
class View:
    """What part of a raster a frame shows, and how large.

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
        Side of the blocks of cells that are drawn as one, where there are more cells than pixels.
    """

    rows: slice
    columns: slice
    origin: tuple[float, float]
    scale: float
    height: int
    width: int
    block: int

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return points (..., 2) as x, y [m] in OpenCV's pixels with `_SHIFT` fractional bits."""
        x = (points[..., 0] - self.origin[0]) * self.scale - 0.5
        y = self.height - (points[..., 1] - self.origin[1]) * self.scale - 0.5
        return np.rint(np.stack([x, y], axis=-1) * (1 << _SHIFT)).astype(np.int32)


def view_of(tables: FloorTables, size: int) -> View:
    """Return the view on a floor's free cells with a margin, the longer side ``size`` pixels."""
    raster = tables.laser
    free = raster.solid == 0
    rows, columns = (_span(free.any(axis=axis), math.ceil(_MARGIN / raster.resolution)) for axis in (1, 0))
    tall, wide = ((span.stop - span.start) * raster.resolution for span in (rows, columns))
    scale = size / max(tall, wide)
    origin = (raster.origin[0] + columns.start * raster.resolution, raster.origin[1] + rows.start * raster.resolution)
    block = max(max(rows.stop - rows.start, columns.stop - columns.start) // size, 1)
    return View(rows, columns, origin, scale, max(round(tall * scale), 1), max(round(wide * scale), 1), block)


def _span(is_used: NDArray[np.bool_], margin: int) -> slice:
    used = np.flatnonzero(is_used)
    low, high = (int(used[0]), int(used[-1]) + 1) if used.size else (0, len(is_used))
    return slice(max(low - margin, 0), min(high + margin, len(is_used)))


def draw_frame(env: "ExplorationEnv", size: int = SIZE) -> Frame:
    """Draw an environment from above.

    The truth: free floor is faint where unexplored and white where the team has sensed it, walls are dark where the team has
    been near. On it the robots with their headings, their last scans as fans, and their ways of the last minute.

    Parameters
    ----------
    env : ExplorationEnv
        After ``reset``.
    size : int
        Longer side of the floor in the frame [pixels], at least 64.

    Returns
    -------
    (rows, columns, 3) uint8
        Red, green, blue; both sides even, as video codecs want them. The caller's own.

    Raises
    ------
    ValueError
        Where the size is too small, or the environment was not reset.
    """
    if size < 64:
        raise ValueError(f"size of the frame is {size} pixels; want at least 64")
    tables = env.world.floors[0]
    if tables is None:
        raise ValueError("the environment was not reset, there is nothing to draw; call reset() first")
    view = view_of(tables, size)
    frame = _draw_floor(env, tables, view)
    colours = team_colours(env.settings.robots)
    _draw_fans(frame, env, view, colours)
    _draw_paths(frame, env, view, colours)
    _draw_robots(frame, env, view, colours)
    width = max(view.width + 2 * _BORDER, 360)
    return _even(np.concatenate([_header(env, width), _framed(frame, width)]))


def _draw_floor(env: "ExplorationEnv", tables: FloorTables, view: View) -> Frame:
    raster = tables.laser
    multiple = round(env.settings.occupancy.resolution / raster.resolution)
    solid = _shrunk(raster.solid[view.rows, view.columns], view.block)
    seen, counted = (
        _shrunk(_on_raster(mask, raster.solid.shape, multiple)[view.rows, view.columns], view.block)
        for mask in (env.world.team_masks[0], env.world.counted_masks[0])
    )
    picture = PALETTE[classify(solid, seen, counted, raster.resolution * view.block)]
    interpolation = cv2.INTER_NEAREST if view.height >= solid.shape[0] else cv2.INTER_AREA
    return np.ascontiguousarray(cv2.resize(picture, (view.width, view.height), interpolation=interpolation)[::-1], dtype=np.uint8)


def _on_raster(mask: NDArray[np.uint64], shape: tuple[int, int], multiple: int) -> NDArray[np.uint8]:
    """Unpack a mask and enlarge its cells, which are ``multiple`` cells of the raster wide and begin at the same corner."""
    cells = unpack_bits(mask, -(-shape[1] // multiple)).view(np.uint8)
    if multiple > 1:
        cells = np.repeat(np.repeat(cells, multiple, axis=0), multiple, axis=1)
    return cells[: shape[0], : shape[1]]


def _shrunk(cells: NDArray[np.uint8], block: int) -> NDArray[np.uint8]:
    """Return 1 for each block of ``block`` x ``block`` cells of which any is not 0."""
    if block == 1:
        return cells
    rows, columns = (side // block for side in cells.shape)
    whole = cells[: rows * block, : columns * block]
    return np.asarray(whole.reshape(rows, block, columns * block).max(axis=1).reshape(rows, columns, block).max(axis=2))


def classify(solid: NDArray[np.uint8], seen: NDArray[np.uint8], counted: NDArray[np.uint8], resolution: float) -> NDArray[np.uint8]:
    """Return what each cell is drawn as, an index into `PALETTE`.

    Parameters
    ----------
    solid, seen, counted : (rows, columns) uint8
        Solid cells, cells that the team has sensed, and those that count.
    resolution : float
        Side of a cell [m].

    Returns
    -------
    (rows, columns) uint8
        0 solid, 1 wall beside something sensed, 2 floor, 3 floor that does not count beside something sensed, 4 floor sensed.
    """
    side = 2 * max(round(_NEAR / resolution), 1) + 1
    near_seen = cv2.dilate(seen, np.ones((side, side), np.uint8))
    beside = np.where(solid != 0, np.uint8(_WALL), np.uint8(_NOT_COUNTED))
    beyond = np.where(solid != 0, np.uint8(_SOLID), np.uint8(_UNEXPLORED))
    # A block of cells may hold both floor and wall: the wall shows.
    classes = np.where((near_seen != 0) & ((counted == 0) | (solid != 0)), beside, beyond)
    classes[(seen != 0) & (solid == 0)] = _EXPLORED
    return classes


def _draw_fans(frame: Frame, env: "ExplorationEnv", view: View, colours: list[Colour]) -> None:
    lidar, world = env.settings.lidar, env.world
    tinted = frame.copy()
    for robot, colour in enumerate(colours):
        x, y, theta = world.poses[robot]
        # No return is drawn to the greatest range, an invalid beam not at all.
        lengths = np.clip(np.nan_to_num(world.ranges[robot].astype(np.float64), nan=0.0, posinf=lidar.range_max), 0.0, lidar.range_max)
        angles = theta + lidar.angles
        ends = np.column_stack([x + lengths * np.cos(angles), y + lengths * np.sin(angles)])
        if not lidar.is_full_circle:
            ends = np.concatenate([[(x, y)], ends])
        cv2.fillPoly(tinted, [view.pixels(ends)], colour, cv2.LINE_AA, _SHIFT)
    cv2.addWeighted(tinted, _FAN_OPACITY, frame, 1.0 - _FAN_OPACITY, 0.0, dst=frame)


def _draw_paths(frame: Frame, env: "ExplorationEnv", view: View, colours: list[Colour]) -> None:
    recent = env.scorer.track[-round(RECENT_S / TRACK_PERIOD_S) :]
    track = np.stack([poses[:, :2] for _, poses in recent] + [env.world.poses[:, :2]])
    thickness = max(round(0.04 * view.scale), 2)
    for robot, colour in enumerate(colours):
        cv2.polylines(frame, [view.pixels(track[:, robot])], False, colour, thickness, cv2.LINE_AA, _SHIFT)


def _draw_robots(frame: Frame, env: "ExplorationEnv", view: View, colours: list[Colour]) -> None:
    fixed = 1 << _SHIFT
    radius = max(env.settings.robot.radius * view.scale, 6.0)
    for robot, colour in enumerate(colours):
        x, y, theta = env.world.poses[robot]
        ahead = np.array([math.cos(theta), math.sin(theta)]) * (radius / view.scale)
        centre, tip = view.pixels(np.stack([(x, y), (x + ahead[0], y + ahead[1])]))
        place = (int(centre[0]), int(centre[1]))
        has_ended = env.possible_agents[robot] not in env.agents
        cv2.circle(frame, place, round((radius + 1.5) * fixed), EXPLORED, -1, cv2.LINE_AA, _SHIFT)
        cv2.circle(frame, place, round(radius * fixed), _paler(colour) if has_ended else colour, -1, cv2.LINE_AA, _SHIFT)
        cv2.line(frame, place, (int(tip[0]), int(tip[1])), EXPLORED, max(round(radius / 4), 1), cv2.LINE_AA, _SHIFT)


def _paler(colour: Colour) -> Colour:
    red, green, blue = (channel + (220 - channel) // 2 for channel in colour)
    return red, green, blue


def _header(env: "ExplorationEnv", width: int) -> Frame:
    """Draw a line of text over a bar of coverage."""
    scale = min(max(width / 960.0, 0.45), 1.0)
    height = round(44 * scale) + 8
    header = np.full((height, width, 3), 255, np.uint8)
    scorer = env.scorer
    coverage = f"{100.0 * scorer.coverage:.1f} %"
    name = "" if env.floor is None else _plain(env.floor.name)
    baseline, margin = round(29 * scale), round(12 * scale)
    right = f"{coverage} explored    {scorer.time:.1f} s"
    _put(header, right, (width - margin - _text_width(right, 0.72 * scale), baseline), INK, 0.72 * scale)
    room = width - 3 * margin - _text_width(right, 0.72 * scale)
    while name and _text_width(name, 0.6 * scale) > room:
        name = name[:-1]
    _put(header, name, (margin, baseline), FAINT_INK, 0.6 * scale)
    header[-6:] = UNEXPLORED
    header[-6:, : round(width * min(scorer.coverage, 1.0))] = (22, 163, 74)
    return header


def _plain(text: str) -> str:
    """Keep what OpenCV's fonts can write."""
    return text.encode("ascii", "replace").decode()


def _text_width(text: str, scale: float) -> int:
    return int(cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0][0])


def _put(picture: Frame, text: str, place: tuple[int, int], colour: Colour, scale: float) -> None:
    cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)


def _framed(picture: Frame, width: int) -> Frame:
    left = (width - picture.shape[1]) // 2
    right = width - picture.shape[1] - left
    return np.asarray(cv2.copyMakeBorder(picture, _BORDER, _BORDER, left, right, cv2.BORDER_CONSTANT, value=BACKGROUND), np.uint8)


def _even(picture: Frame) -> Frame:
    rows, columns = picture.shape[0] % 2, picture.shape[1] % 2
    return np.asarray(cv2.copyMakeBorder(picture, 0, rows, 0, columns, cv2.BORDER_CONSTANT, value=BACKGROUND), np.uint8)


class FrameWindow:
    """A window that shows frames; where there is no display it says so once and does nothing.

    Parameters
    ----------
    title : str
        Title of the window.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._figure: Any = None
        self._image: Any = None
        self._is_off = False

    def show(self, frame: Frame) -> None:
        """Show a frame; opens the window with the first one. A window that the user has closed stays closed."""
        if self._is_off:
            return
        from matplotlib import pyplot

        if self._figure is None:
            self._open(frame)
            if self._figure is None:
                return
        elif not pyplot.fignum_exists(self._figure.number):
            self._is_off = True
            return
        if self._image.get_array().shape != frame.shape:
            self._image.set_extent((-0.5, frame.shape[1] - 0.5, frame.shape[0] - 0.5, -0.5))
        self._image.set_data(frame)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window, if there is one; closing again does nothing."""
        if self._figure is not None:
            from matplotlib import pyplot

            pyplot.close(self._figure)
            self._figure = self._image = None

    def _open(self, frame: Frame) -> None:
        from matplotlib import pyplot

        figure = None
        try:
            # Making a figure settles which backend there is; each toolkit has an error of its own for want of a display.
            figure = pyplot.figure(self._title, figsize=(frame.shape[1] / 100.0, frame.shape[0] / 100.0), dpi=100)
            has_display = figure.canvas.required_interactive_framework is not None
        except Exception:
            has_display = False
        if not has_display or figure is None:
            if figure is not None:
                pyplot.close(figure)
            self._is_off = True
            warnings.warn(
                "render_mode is 'human', but there is no display to open a window on; nothing is shown (use 'rgb_array' for frames)",
                UserWarning,
                stacklevel=4,
            )
            return
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        self._image = axes.imshow(frame, interpolation="antialiased")
        self._figure = figure
        pyplot.show(block=False)
