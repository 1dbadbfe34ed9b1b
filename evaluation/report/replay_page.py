"""The replay of a recorded episode as a page holds it.

The same version runs the episode again for it; of other versions the page shows the record.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import team_colours
from lidarium.envs.drawing.prediction_layer import PredictionLayer
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.evaluation.drawing.record_frames import radius_of
from lidarium.evaluation.episodes.watching import Watcher
from lidarium.evaluation.record.episode_record import EpisodeRecord
from lidarium.evaluation.record.replay import drive_again, first_difference, is_same
from lidarium.evaluation.report import map_layers
from lidarium.evaluation.report.map_layers import (
    Grid,
    Layer,
    coarse,
    grid_around,
    packed,
    signed_varints,
    varints,
)
from lidarium.evaluation.truth.beliefs import believed_on_floor, map_within
from lidarium.evaluation.truth.true_map import occupied_in_truth, truth_of
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.prediction.levels import factor_of

MAP_PERIOD_S, SCAN_PERIOD_S = 1.0, 0.4
"""Minimum time between samples of maps, and of scans [s]; that of scans is a multiple of that of poses."""

MOST_MAPS, MOST_SCANS = 600, 1500
"""Maximum number of samples of an episode; those of a longer one are further apart."""

PREDICTION_PERIOD_S = 2.0
"""Minimum time between samples of the prediction [s]."""

PROBABILITIES = 8
"""The page tells so many probabilities above 0 apart."""

_LEAST_CHANGE = 0.75
"""Changes of a probability that are shown are larger, in steps of the page."""

MOST_BEAMS = 60
"""Maximum number of beams of a scan of the page."""


@dataclass(slots=True)
class _Samples:
    """Samples of an episode in addition to its record.

    Attributes
    ----------
    grid : Grid
        Which part of the lattice of the maps is shown.
    truth : Layer
        Occupied cells.
    team : Layer
        The sum of all maps.
    own : list of Layer
        Maps of each robot's own scans; empty for a single robot, which has the team's map.
    map_times, scan_times : list of float
        When samples were taken [s].
    scans : list of (robots, beams) float32
        Ranges [m]; inf for no return.
    believed : list of (robots, 3) float64
        Believed poses in the floor's frame, with the scans; none if poses are true.
    """

    grid: Grid
    truth: Layer
    team: Layer
    own: list[Layer]
    map_times: list[float] = field(default_factory=list)
    scan_times: list[float] = field(default_factory=list)
    scans: list[NDArray[np.float32]] = field(default_factory=list)
    believed: list[NDArray[np.float64]] = field(default_factory=list)


class _PredictionTrack:
    """What the network predicts beyond the team's map of the page, from sample to sample."""

    def __init__(self, grid: Grid, cell_m: float) -> None:
        self._cell_m, self._layer, self._due_s = cell_m, PredictionLayer(), 0.0
        factor = factor_of(cell_m)
        rows, columns = -(-grid.rows // factor), -(-grid.columns // factor)
        self.squares = Layer(np.zeros((rows, columns), np.uint8))
        self.header = {"rows": rows, "columns": columns, "cells": factor, "steps": PROBABILITIES}

    def add(self, levels: NDArray[np.uint8], time_s: float, *, is_last: bool = False) -> None:
        """Take a sample of the map of the page; between those of the prediction it stays as it is."""
        found = self.squares.levels
        if time_s >= self._due_s - 1e-9 or is_last:
            self._due_s = time_s + PREDICTION_PERIOD_S
            known = (levels == map_layers.OCCUPIED).astype(np.int8) - (levels == map_layers.FREE)
            free = PROBABILITIES * self._layer.squares(known, self._cell_m)[0]
            # Small changes are left out: they would be most of the page.
            found = np.where(np.abs(free - found) > _LEAST_CHANGE, np.rint(free), found).astype(np.uint8)
        self.squares.add(found)


class ReplaySampler(Watcher):
    """Samples an episode as it runs."""

    samples: _Samples

    def __init__(self, duration_s: float, predicts: bool = False) -> None:
        self._predicts = predicts
        self._map_period = max(MAP_PERIOD_S, duration_s / MOST_MAPS)
        scans = max(SCAN_PERIOD_S, duration_s / MOST_SCANS)
        self._scan_period = SCAN_PERIOD_S * math.ceil(scans / SCAN_PERIOD_S - 1e-9)

    def begin(self, env: ExplorationEnv) -> None:
        """Choose the part that is shown, and take the first samples."""
        settings, truth = env.settings, truth_of(env)
        grid = grid_around(truth.knowable, settings.occupancy.resolution)
        own = settings.robots if settings.robots > 1 else 0
        self.samples = _Samples(grid, Layer.blank(grid), Layer.blank(grid), [Layer.blank(grid) for _ in range(own)])
        self.prediction = _PredictionTrack(grid, grid.block * settings.occupancy.resolution) if self._predicts else None
        occupied = occupied_in_truth(env)[grid.window]
        self.samples.truth.add(coarse(occupied, np.zeros_like(occupied), grid.block))
        self._reach = settings.lidar.range_max + settings.speed_limits[:, 0].max() * self._map_period + 0.5
        self._renderings = env.beliefs.renderings.copy()
        self._steps_of_map = max(round(self._map_period / settings.time_step), 1)
        steps = max(round(self._scan_period / settings.time_step), 1)
        # Samples are of steps in which robots scan.
        self._steps_of_scan = -(-steps // settings.scan_steps) * settings.scan_steps
        self._choose_beams(settings)
        self._last = self._places(env)
        self._sample_maps(env, is_whole=True)
        self._sample_scans(env)

    def step(self, env: ExplorationEnv, commands: NDArray[np.float64], /) -> None:
        """Take samples if it is time."""
        steps = int(env.world.steps[0])
        if steps % self._steps_of_scan == 0:
            self._sample_scans(env)
        if steps % self._steps_of_map == 0:
            self._sample_maps(env)

    def finish(self, env: ExplorationEnv) -> _Samples:
        """Take the last samples, and return all."""
        self._sample_maps(env, is_whole=True)
        return self.samples

    def beam_angles(self, env: ExplorationEnv) -> list[float]:
        """Return the angles of the sampled beams against the heading [rad]."""
        return [round(float(angle), 5) for angle in env.settings.lidar.angles[:: self._stride]]

    def _choose_beams(self, settings: ExplorationSettings) -> None:
        """Choose the beam of each robot that is sampled at each angle of the page; some views may not reach it."""
        self._stride = -(-settings.lidar.beams // MOST_BEAMS)
        angles = settings.lidar.angles[:: self._stride]
        lidars = settings.team_lidars
        nearest = np.stack([np.rint((angles - lidar.angle_first) / lidar.angle_increment) for lidar in lidars])
        self._is_in_view = (nearest >= 0) & (nearest < settings.lidar.beams)
        self._nearest = np.where(self._is_in_view, nearest, 0).astype(np.int64)

    def _sample_scans(self, env: ExplorationEnv) -> None:
        samples = self.samples
        samples.scan_times.append(int(env.world.steps[0]) * env.settings.time_step)
        ranges = np.take_along_axis(env.simulation.ranges, self._nearest, axis=1)
        samples.scans.append(np.where(self._is_in_view, ranges, np.float32(np.inf)))
        if env.settings.localization != "truth":
            samples.believed.append(believed_on_floor(env))

    def _places(self, env: ExplorationEnv) -> NDArray[np.float64]:
        """Return the true and believed positions of the robots, (2 robots, 2) [m]."""
        return np.concatenate([env.world.poses[:, :2], believed_on_floor(env)[:, :2]])

    def _sample_maps(self, env: ExplorationEnv, *, is_whole: bool = False) -> None:
        """Take a sample of all maps; they change near the robots only, unless they were rendered again."""
        samples, grid, block = self.samples, self.samples.grid, self.samples.grid.block
        is_whole |= not np.array_equal(self._renderings, env.beliefs.renderings)
        self._renderings[:] = env.beliefs.renderings
        places = self._places(env)
        rows, columns = self._changed(env, np.concatenate([places, self._last]), is_whole)
        self._last = places
        window = (
            slice(grid.row + rows.start * block, grid.row + rows.stop * block),
            slice(grid.column + columns.start * block, grid.column + columns.stop * block),
        )
        maps = [map_within(env, row, *window) for row in range(env.settings.robots)]
        together = np.asarray(np.sum(maps, axis=0, dtype=np.int16))
        of_layers: list[NDArray[np.signedinteger[Any]]] = [together, *maps]
        for layer, log_odds in zip([samples.team, *samples.own], of_layers, strict=False):
            levels = layer.levels.copy()
            levels[rows, columns] = coarse(np.asarray(log_odds > 0), np.asarray(log_odds < 0), block)
            layer.add(levels)
        samples.map_times.append(int(env.world.steps[0]) * env.settings.time_step)
        if self.prediction is not None:
            self.prediction.add(samples.team.levels, samples.map_times[-1], is_last=is_whole)

    def _changed(self, env: ExplorationEnv, places: NDArray[np.float64], is_whole: bool) -> tuple[slice, slice]:
        """Return the rows and columns of the page's grid that may have changed."""
        grid = self.samples.grid
        if is_whole:
            return slice(0, grid.rows), slice(0, grid.columns)
        tables, resolution = env.world.floors[0], env.settings.occupancy.resolution
        assert tables is not None
        corner = np.array(tables.laser.origin) + np.array([grid.column, grid.row]) * resolution
        low = (places.min(axis=0) - self._reach - corner) / (grid.block * resolution)
        high = (places.max(axis=0) + self._reach - corner) / (grid.block * resolution)
        sides = []
        for axis, size in ((1, grid.rows), (0, grid.columns)):
            first = min(max(int(low[axis]), 0), size)
            sides.append(slice(first, min(max(int(high[axis]) + 1, first), size)))
        return sides[0], sides[1]


_HUNDREDTHS = 1e2
_MILLI = 1e3
_SHARES = 1e6
SCAN_UNIT_M = 0.02
"""Ranges of a page are whole numbers of these [m]."""

Streams = dict[str, bytes]


@dataclass(frozen=True, slots=True)
class Replay:
    """An episode for a page.

    Attributes
    ----------
    title : str
        Title for people.
    text : str
        Output of `packed`.
    lacks : str
        Reason why scans, the truth and own maps are missing; empty if they are present.
    """

    title: str
    text: str
    lacks: str = ""


def replay_of(record: EpisodeRecord, floor: str | Floor | None = None, predicts: bool = False) -> Replay:
    """Return the replay of a record; the prediction is in it with ``predicts``, or if the robots predicted."""
    header, display, predicts = record.header, record.display, predicts or record.predicts
    lacks = ""
    try:
        more, streams = _run_again(record, floor, predicts)
    except ValueError as error:
        lacks = printable(str(error))
        more, streams = _as_recorded(record, predicts)
    title = _title(header)
    about = {
        "title": title,
        "floor": printable(str(header["floor"])),
        "policy": printable(str(header["policy"] or "")),
        "seed": header["seed"],
        "robots": header["robots"],
        "version": printable(str(header["version"])),
        "interrupted": header["interrupted"],
        "lacks": lacks,
        "duration_s": round(float(display.times[-1]), 3),
        "radius_m": radius_of(record),
        "known_starts": bool(header["settings"].get("known_starts", True)),
        "colours": [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in team_colours(header["robots"])],
        "events": [_plain(event) for event in display.events],
        "people_radius_m": [] if display.crowd is None else display.crowd.people[0, :, 2].tolist(),
        "doors": [] if display.crowd is None else display.crowd.doors.tolist(),
        **more,
    }
    return Replay(title, packed(about, {**_track(record), **streams}), lacks)


def _title(header: dict[str, Any]) -> str:
    who = header["policy"] or "an unnamed policy"
    seed = "" if header["seed"] is None else f", seed {header['seed']}"
    return printable(f"{who} on {header['floor']}, {header['robots']} robots{seed}")


def _plain(event: dict[str, Any]) -> dict[str, Any]:
    """Return an event with printable words; numbers that JSON does not have become null."""
    shown: dict[str, Any] = {}
    for key, value in event.items():
        is_number = isinstance(value, int | float) and math.isfinite(value)
        shown[printable(str(key))] = value if value is None or is_number else printable(str(value))
    return shown


def _track(record: EpisodeRecord) -> Streams:
    """Return paths, coverage, people and doors, coded as small differences."""
    display, crowd = record.display, record.display.crowd
    poses = display.poses.reshape(len(display.times), -1, 3).copy()
    poses[..., 2] = np.unwrap(poses[..., 2], axis=0)
    streams = {
        "pose_times": _differences(display.times, _MILLI),
        "poses": _differences(poses.reshape(len(poses), -1), _MILLI),
        "coverage_times": _differences(display.coverage[:, 0], _MILLI),
        "coverage": _differences(display.coverage[:, 1], _SHARES),
    }
    if crowd is not None:
        streams["crowd_times"] = _differences(crowd.times, _MILLI)
        streams["people"] = _differences(crowd.people[..., :2].reshape(len(crowd.times), -1), _MILLI)
        streams["opened"] = _differences(crowd.opened, _HUNDREDTHS)
    return streams


def _differences(values: Any, scale: float) -> bytes:  # noqa: ANN401
    """Return rows of numbers as whole multiples of 1 / scale, each less the row before; column by column."""
    whole = np.rint(np.asarray(values, np.float64) * scale).astype(np.int64)
    return signed_varints(np.diff(whole, axis=0, prepend=0).T)


def _run_again(record: EpisodeRecord, floor: str | Floor | None, predicts: bool) -> tuple[dict[str, Any], Streams]:
    sampler = ReplaySampler(float(record.display.times[-1]), predicts)
    env = drive_again(record, floor, [sampler])
    if not is_same(record, env):
        raise ValueError(f"the episode does not run as it was recorded: {first_difference(record, env)}")
    samples = sampler.finish(env)
    layers = {"team": samples.team} | {f"robot_{robot}": own for robot, own in enumerate(samples.own)}
    more = {
        **_grid_header(env, sampler),
        "layers": list(layers),
        "has_truth": True,
        "beam_angles": sampler.beam_angles(env),
        "scan_unit_m": SCAN_UNIT_M,
        "has_beliefs": bool(samples.believed),
    }
    streams = {
        "truth": bytes(samples.truth.changes),
        "map_times": _differences(samples.map_times, _MILLI),
        **{f"map_{name}": bytes(layer.changes) for name, layer in layers.items()},
        "scan_times": _differences(samples.scan_times, _MILLI),
        "scans": _scans(np.stack(samples.scans)),
    }
    if samples.believed:
        believed = np.unwrap(np.stack(samples.believed), axis=0)
        streams["believed"] = _differences(believed.reshape(len(believed), -1), _MILLI)
    return _with_prediction(more, streams, sampler.prediction)


def _with_prediction(
    more: dict[str, Any], streams: Streams, prediction: _PredictionTrack | None
) -> tuple[dict[str, Any], Streams]:
    """Return header and streams with those of the prediction, if there is one."""
    if prediction is None:
        return {**more, "prediction": None}, streams
    return {**more, "prediction": prediction.header}, {**streams, "prediction": bytes(prediction.squares.changes)}


def _grid_header(env: ExplorationEnv, sampler: ReplaySampler) -> dict[str, Any]:
    tables = env.world.floors[0]
    assert tables is not None
    grid = sampler.samples.grid
    return {"grid": grid.header(tables.laser.origin, env.settings.occupancy.resolution)}


def _scans(ranges: NDArray[np.float32]) -> bytes:
    """Return ranges as whole numbers, each less that of the beam before; 0 is no return."""
    whole = np.where(np.isfinite(ranges), np.maximum(np.rint(ranges / SCAN_UNIT_M), 1), 0).astype(np.int64)
    return signed_varints(np.diff(whole, axis=-1, prepend=0))


def _as_recorded(record: EpisodeRecord, predicts: bool) -> tuple[dict[str, Any], Streams]:
    display = record.display
    grid = grid_around(display.map_at(math.inf) != UNKNOWN, display.resolution)
    team = Layer.blank(grid)
    prediction = _PredictionTrack(grid, grid.block * display.resolution) if predicts else None
    for time_s in display.changes.times:
        levels = display.map_at(float(time_s))[grid.window]
        team.add(coarse(levels == OCCUPIED, levels == FREE, grid.block))
        if prediction is not None:
            prediction.add(team.levels, float(time_s), is_last=time_s == display.changes.times[-1])
    more = {
        "grid": grid.header(display.origin, display.resolution),
        "layers": ["team"],
        "has_truth": False,
        "beam_angles": [],
        "scan_unit_m": SCAN_UNIT_M,
        "has_beliefs": False,
    }
    times = varints([]) if not len(display.changes.times) else _differences(display.changes.times, _MILLI)
    return _with_prediction(more, {"map_times": times, "map_team": bytes(team.changes)}, prediction)
