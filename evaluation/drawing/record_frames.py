"""Pictures of records, which any version can draw, and frames of films.

They show the team's map, paths, coverage, targets and endings.
"""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import (
    EXPLORED,
    RECENT_S,
    SHIFT,
    SIZE,
    UNEXPLORED,
    WALL,
    Frame,
    blocks_of,
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
from lidarium.envs.drawing.views import camera_panel, views_of
from lidarium.envs.engine.tally import THRESHOLDS
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.cameras import DepthCamera
from lidarium.envs.settings.exploration import with_parts
from lidarium.envs.settings.robots import Robot
from lidarium.evaluation.drawing.picture_parts import (
    INK,
    SOLID,
    box_around,
    draw_curve,
    draw_people_and_doors,
    draw_trajectories,
    drawn_together,
    list_robots,
    page,
    prediction_patch,
    rgb,
    save_titled_figure,
    show_cells,
    with_prediction,
)
from lidarium.evaluation.metrics.progress import path_lengths
from lidarium.evaluation.record.episode_record import DisplayTrack, EpisodeRecord
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.speckle_filter import without_small_components

_PALETTE = np.zeros((256, 3), np.uint8)
_PALETTE[[OCCUPIED, UNKNOWN, FREE]] = WALL, UNEXPLORED, EXPLORED
_DEFAULT_RADIUS = 0.18
_UNSEEN = "#dfe3ea"


class TrackFrames:
    """Draws a record at any time.

    Parameters
    ----------
    shown : (rows, columns) bool or None
        Cells of the team's map that frames show; those that the team knows at the end if None.
    predicts : bool
        Whether unknown space is the bluer the more probably it is free; if the robots predicted their maps, it always
        is.
    """

    def __init__(
        self,
        record: EpisodeRecord,
        size: int = SIZE,
        floor: Floor | None = None,
        shown: NDArray[np.bool_] | None = None,
        predicts: bool = False,
    ) -> None:
        self._record, self._display = record, record.display
        display = record.display
        shown = known_at_end(record) if shown is None else shown
        self.view = view_around(shown, display.origin, display.resolution, size)
        self._prediction = PredictionLayer() if predicts or record.predicts else None
        self._sample, self._map = -1, np.zeros((0, 0, 3), np.uint8)
        self._agents = [f"robot_{robot}" for robot in range(display.poses.shape[1])]
        self._colours = team_colours(len(self._agents))
        camera, robot = (record.header["settings"].get(name) for name in ("camera", "robot"))
        self._camera = with_parts(DepthCamera, camera) if floor is not None and camera else None
        self._views = None if floor is None else views_of(floor, with_parts(Robot, robot or {}), len(self._agents))

    def draw(self, time_s: float) -> Frame:
        """Return the frame at a time: `picture` below a header, next to a camera's view."""
        coverage = self._display.coverage_at(time_s)
        frame = with_header(self.picture(time_s), self._record.header["floor"], coverage, time_s)
        if self._camera is None:
            return frame
        return self._with_panel(frame, self._camera, self._display.poses_at(time_s))

    def picture(self, time_s: float) -> Frame:
        """Return the team's map at a time, with paths, targets and robots.

        Paths are those of the last minute, targets are rings, and robots have their headings.
        """
        display, view = self._display, self.view
        frame = self._map_at(time_s)
        recent = (display.times >= time_s - RECENT_S) & (display.times <= time_s + 1e-9)
        poses = display.poses_at(time_s)
        draw_paths(frame, view, np.concatenate([display.poses[recent, :, :2], poses[None, :, :2]]), self._colours)
        self._draw_targets(frame, time_s, poses)
        ended = {
            event["agent"] for event in display.events if event["kind"] == "ended" and event["time_s"] <= time_s + 1e-9
        }
        has_ended = [agent in ended for agent in self._agents]
        draw_crowd(frame, view, display.crowd_at(time_s))
        draw_robots(frame, view, poses, radius_of(self._record), has_ended, self._colours)
        return frame

    def _map_at(self, time_s: float) -> Frame:
        """Return the picture of the team's map alone, the caller's own.

        It is drawn again when the map changes, which it does less often than robots move.
        """
        sample = int(np.searchsorted(self._display.changes.times, time_s + 1e-9, side="right"))
        if sample != self._sample:
            view = self.view
            whole = without_small_components(self._display.map_at(time_s))
            levels = blocks_of(whole[view.rows, view.columns], view)
            picture = _PALETTE[levels]
            if self._prediction is not None:
                free = thinned(
                    _free_beyond(self._prediction, whole, self._display)[view.rows, view.columns], view.block
                )
                picture = tinted(picture, STRENGTH * (levels == UNKNOWN) * free)
            self._sample, self._map = sample, enlarged(picture, view)
        return self._map.copy()

    def _with_panel(self, frame: Frame, camera: DepthCamera, poses: NDArray[np.float64]) -> Frame:
        """Put the view of the first robot's camera next to a frame."""
        assert self._views is not None
        level = np.zeros_like(poses)
        depth = self._views.depth(poses, level, 0, camera)
        panel = camera_panel(self._views, poses, level, depth, camera, len(frame))
        return np.concatenate([frame, panel], axis=1)

    def _draw_targets(self, frame: Frame, time_s: float, poses: NDArray[np.float64]) -> None:
        """Draw the target of each robot as a ring, with a thin line to it."""
        targets: dict[str, tuple[float, float] | None] = {}
        for event in self._display.events:
            if event["time_s"] > time_s + 1e-9:
                break
            if event["kind"] == "decision" and "x" in event:
                targets[event["agent"]] = None if event["x"] is None else (event["x"], event["y"])
            elif event["kind"] == "ended":
                targets[event["agent"]] = None
        radius = max(round(0.12 * self.view.scale), 5)
        for agent, pose, colour in zip(self._agents, poses, self._colours, strict=True):
            target = targets.get(agent)
            if target is not None:
                here, there = (
                    tuple(int(value) for value in point) for point in self.view.pixels(np.array([pose[:2], target]))
                )
                cv2.line(frame, here, there, colour, 1, cv2.LINE_AA, SHIFT)
                cv2.circle(frame, there, radius << SHIFT, EXPLORED, -1, cv2.LINE_AA, SHIFT)
                cv2.circle(frame, there, radius << SHIFT, colour, 2, cv2.LINE_AA, SHIFT)


def _free_beyond(layer: PredictionLayer, levels: NDArray[np.uint8], display: DisplayTrack) -> NDArray[np.float32]:
    """Return the probability that unknown cells of the team's map are free, 0 for known ones."""
    return layer.cells((levels == OCCUPIED).astype(np.int8) - (levels == FREE), display.resolution)


def known_at_end(record: EpisodeRecord) -> NDArray[np.bool_]:
    """Return which cells of the team's map are known at the end, (rows, columns)."""
    return np.asarray(record.display.map_at(math.inf) != UNKNOWN)


def save_track_picture(path: Path, record: EpisodeRecord, predicts: bool = False) -> None:
    """Draw the end of a record (PNG, written whole or not at all).

    It shows the team's map, all paths, coverage over time and endings; with ``predicts``, or if the robots predicted
    their maps, also what is probably free beyond.
    """
    header, display = record.header, record.display
    levels = without_small_components(display.map_at(math.inf))
    box = box_around(levels != UNKNOWN, display.origin, display.resolution)
    figure, floor_axes, curve_axes, team_axes = page(box.aspect)
    # In order of priority if cells are drawn together.
    classes = np.zeros(levels.shape, np.uint8)
    classes[levels == FREE], classes[levels == OCCUPIED] = 1, 2
    palette = np.stack([rgb(colour) for colour in (_UNSEEN, "#ffffff", INK)])
    drawn = drawn_together(classes[box.rows, box.columns])
    cells = palette[drawn]
    more: list[Patch | Line2D] = []
    if predicts or record.predicts:
        free = _free_beyond(PredictionLayer(), levels, display)[box.rows, box.columns]
        cells = with_prediction(cells, drawn == 0, free)
        more.append(prediction_patch(_UNSEEN))
    show_cells(floor_axes, cells, box, _UNSEEN)
    draw_trajectories(floor_axes, display.poses, radius_of(record))
    _draw_legend(figure, [*more, *draw_people_and_doors(floor_axes, display.crowd_at(math.inf))])
    end, coverage = float(display.times[-1]), float(display.coverage[-1, 1])
    reached = {
        share: float(display.coverage[display.coverage[:, 1] >= share, 0][0])
        for share in THRESHOLDS
        if coverage >= share
    }
    draw_curve(curve_axes, display.coverage, reached, end)
    lengths = path_lengths(display.poses)
    endings = {event["agent"]: event["reason"] for event in display.events if event["kind"] == "ended"}
    robots = [
        (endings.get(f"robot_{robot}", "still at work"), f"{length:.1f} m") for robot, length in enumerate(lengths)
    ]
    below = [f"{kind}: {count}" for kind, count in _counts(display.events).items()]
    list_robots(team_axes, ("drove",), robots, below)
    how = ", interrupted" if header["interrupted"] else ""
    title = f"{header['floor']}: {100.0 * coverage:.1f} % explored in {end:.1f} s{how}"
    team = "1 robot" if len(lengths) == 1 else f"{len(lengths)} robots"
    about = [
        team,
        header["policy"],
        "" if header["seed"] is None else f"seed {header['seed']}",
        f"lidarium {header['version']}",
    ]
    save_titled_figure(path, figure, title, ", ".join(part for part in about if part))


def radius_of(record: EpisodeRecord) -> float:
    """Return the radius of the bodies [m], as the settings of the record have it."""
    robot = record.header["settings"].get("robot", {})
    return float(robot.get("radius", _DEFAULT_RADIUS)) if isinstance(robot, dict) else _DEFAULT_RADIUS


def _counts(events: list[dict[str, Any]]) -> dict[str, int]:
    """Count the events of each kind but endings, which are listed by themselves."""
    names = {
        "decision": "decisions",
        "contact": "contacts",
        "given_up": "given up on the way",
        "message": "messages",
        "merge": "merges",
    }
    kinds = [str(event["kind"]) for event in events if event["kind"] != "ended"]
    return {names.get(kind, kind): kinds.count(kind) for kind in dict.fromkeys(kinds)}


def _draw_legend(figure: Figure, more: list[Patch | Line2D]) -> None:
    start: dict[str, Any] = {"markerfacecolor": "white", "markeredgecolor": INK, "markeredgewidth": 1.6}
    entries: list[Patch | Line2D] = [
        Patch(facecolor="white", edgecolor=SOLID, label="free on the team's map"),
        Patch(facecolor=INK, label="occupied"),
        Patch(facecolor=_UNSEEN, label="unknown"),
        Line2D([], [], marker="o", markersize=9, linewidth=0, label="start", **start),
        Line2D([], [], marker="o", markersize=9, color=INK, linewidth=0, label="end"),
        *more,
    ]
    figure.legend(
        handles=entries,
        loc="outside lower left",
        ncols=6,
        frameon=False,
        fontsize=8.5,
        labelcolor=INK,
        handlelength=1.2,
    )
