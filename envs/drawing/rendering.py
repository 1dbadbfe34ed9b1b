"""Frames of the floor from above.

They show the explored area, the robots and the range of their lasers.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import (
    BACKGROUND,
    EXPLORED,
    NOT_COUNTED,
    SHIFT,
    SIZE,
    UNEXPLORED,
    WALL,
    Cell,
    Colour,
    Frame,
    View,
    draw_crowd,
    draw_paths,
    draw_robots,
    enlarged,
    team_colours,
    thinned,
    view_around,
    with_header,
)
from lidarium.envs.drawing.prediction_layer import STRENGTH, PredictionLayer, tinted
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.people.crowd import crowd_of
from lidarium.envs.simulation.simulation import Simulation

_NEAR = 0.125
_FAN_OPACITY = 0.22
_SOLID, _WALL, _UNEXPLORED, _NOT_COUNTED, _EXPLORED = range(5)
PALETTE = np.array([BACKGROUND, WALL, UNEXPLORED, NOT_COUNTED, EXPLORED], np.uint8)
"""Colours of the classes of `classify`."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Content of a frame.

    Attributes
    ----------
    simulation : Simulation
        Simulation of one episode or many.
    settings : ExplorationSettings
        The team.
    name : str
        The floor's.
    has_ended : list of bool
        Which robots have ended.
    track : list of (robots, 3) float64
        True poses of the last time; none if they are not kept.
    episode : int
        Which episode.
    prediction : PredictionLayer or None
        Shows what is probably free beyond the team's maps; None for frames without it.
    """

    simulation: Simulation
    settings: ExplorationSettings
    name: str
    has_ended: list[bool]
    track: list[NDArray[np.float64]]
    episode: int = 0
    prediction: PredictionLayer | None = None

    @property
    def rows(self) -> slice:
        """Rows of the episode's robots."""
        robots = self.settings.robots
        return slice(self.episode * robots, (self.episode + 1) * robots)

    @property
    def poses(self) -> NDArray[np.float64]:
        """True poses of the episode's robots, (robots, 3)."""
        return self.simulation.world.poses[self.rows]


def view_of(tables: FloorTables, size: int) -> View:
    """Return the view on a floor's free cells with a margin.

    The longer side is ``size`` pixels.
    """
    raster = tables.laser
    return view_around(raster.solid == 0, raster.origin, raster.resolution, size)


def draw_frame(scene: Scene, size: int = SIZE, draw_over: Callable[[Frame, View], None] | None = None) -> Frame:
    """Draw an environment from above.

    True state: free floor is faint if unexplored and white if the team has sensed it, walls are dark if the
    team has been near. On it the robots with their headings, their last scans as fans, and their paths of the last
    minute. If robots have cameras, the view of the first one is at its side. With a prediction, what is not explored is
    the bluer the more probably it is free.

    Returns
    -------
    (rows, columns, 3) uint8
        Red, green, blue; both sides even, as video codecs want them. The caller's own.
    """
    if size < 64:
        raise ValueError(f"size of the frame is {size} pixels; want at least 64")
    tables = scene.simulation.world.floors[scene.episode]
    if tables is None:
        raise ValueError("the environment was not reset, there is nothing to draw; call reset() first")
    view = view_of(tables, size)
    frame = _draw_floor(scene, tables, view)
    colours = team_colours(scene.settings.robots)
    _draw_fans(frame, scene, view, colours)
    draw_paths(frame, view, np.stack([poses[:, :2] for poses in (*scene.track, scene.poses)]), colours)
    draw_crowd(frame, view, crowd_of(scene.simulation.population, scene.episode))
    radii = [robot.radius for robot in scene.settings.team]
    draw_robots(frame, view, scene.poses, radii, scene.has_ended, colours)
    if draw_over is not None:
        draw_over(frame, view)
    simulation, episode = scene.simulation, scene.episode
    time_s = float(simulation.world.steps[episode]) * scene.settings.time_step
    frame = with_header(frame, scene.name, simulation.score.coverage(episode), time_s)
    return _with_panel(frame, scene, tables) if simulation.episodes == 1 else frame


def _with_panel(frame: Frame, scene: Scene, tables: FloorTables) -> Frame:
    """Put the camera view of the first robot next to a frame, if it has a camera."""
    sensor, world = scene.simulation.camera, scene.simulation.world
    if sensor is None or tables.floor is None:
        return frame
    from lidarium.envs.drawing.views import camera_panel, views_of

    robots = scene.settings.robots
    views = views_of(tables.floor, scene.settings.robot, robots)
    panel = camera_panel(
        views, world.poses[:robots], world.attitudes[:robots], sensor.frames[0], sensor.camera, len(frame)
    )
    return np.concatenate([frame, panel], axis=1)


def _draw_floor(scene: Scene, tables: FloorTables, view: View) -> Frame:
    raster = tables.laser
    multiple = round(scene.settings.occupancy.resolution / raster.resolution)
    solid = _shrunk(raster.solid[view.rows, view.columns], view.block)
    seen, counted = (
        _shrunk(_on_raster(mask, raster.solid.shape, multiple)[view.rows, view.columns], view.block)
        for mask in (
            scene.simulation.score.team_masks[scene.episode],
            scene.simulation.score.counted_masks[scene.episode],
        )
    )
    classes = classify(solid, seen, counted, raster.resolution * view.block)
    picture = PALETTE[classes]
    if scene.prediction is not None:
        free = scene.prediction.on_floor(scene.simulation, scene.settings, scene.episode)
        free = thinned(_spread(free, raster.solid.shape, multiple)[view.rows, view.columns], view.block)
        picture = tinted(picture, STRENGTH * free * ((classes == _SOLID) | (classes == _UNEXPLORED)))
    return enlarged(picture, view)


def _on_raster(mask: NDArray[np.uint64], shape: tuple[int, int], multiple: int) -> NDArray[np.uint8]:
    """Unpack a mask and enlarge its cells, as `_spread` does."""
    return _spread(unpack_bits(mask, -(-shape[1] // multiple)).view(np.uint8), shape, multiple)


def _spread(cells: NDArray[Cell], shape: tuple[int, int], multiple: int) -> NDArray[Cell]:
    """Return cells on a raster; they are ``multiple`` of its cells wide and begin at the same corner."""
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


def classify(
    solid: NDArray[np.uint8], seen: NDArray[np.uint8], counted: NDArray[np.uint8], resolution: float
) -> NDArray[np.uint8]:
    """Return the class of each cell, an index into `PALETTE`.

    Parameters
    ----------
    solid, seen, counted : (rows, columns) uint8
        Solid cells, cells that the team has sensed, and those that count.
    resolution : float
        Side of a cell [m].

    Returns
    -------
    (rows, columns) uint8
        0 solid, 1 wall next to a sensed cell, 2 floor, 3 floor that does not count next to a sensed cell, 4 sensed
        floor.
    """
    side = 2 * max(round(_NEAR / resolution), 1) + 1
    near_seen = cv2.dilate(seen, np.ones((side, side), np.uint8))
    beside = np.where(solid != 0, np.uint8(_WALL), np.uint8(_NOT_COUNTED))
    beyond = np.where(solid != 0, np.uint8(_SOLID), np.uint8(_UNEXPLORED))
    # A block of cells may hold both floor and wall: the wall shows.
    classes = np.where((near_seen != 0) & ((counted == 0) | (solid != 0)), beside, beyond)
    classes[(seen != 0) & (solid == 0)] = _EXPLORED
    return classes


def _draw_fans(frame: Frame, scene: Scene, view: View, colours: list[Colour]) -> None:
    ranges, poses = scene.simulation.ranges[scene.rows], scene.simulation.scan_poses[scene.rows]
    tinted = frame.copy()
    for robot, (lidar, colour) in enumerate(zip(scene.settings.team_lidars, colours, strict=True)):
        x, y, theta = poses[robot]
        # No return is drawn to the greatest range, an invalid beam not at all.
        lengths = np.clip(
            np.nan_to_num(ranges[robot].astype(np.float64), nan=0.0, posinf=lidar.range_max),
            0.0,
            lidar.range_max,
        )
        angles = theta + lidar.angles
        ends = np.column_stack([x + lengths * np.cos(angles), y + lengths * np.sin(angles)])
        if not lidar.is_full_circle:
            ends = np.concatenate([[(x, y)], ends])
        cv2.fillPoly(tinted, [view.pixels(ends)], colour, cv2.LINE_AA, SHIFT)
    cv2.addWeighted(tinted, _FAN_OPACITY, frame, 1.0 - _FAN_OPACITY, 0.0, dst=frame)
