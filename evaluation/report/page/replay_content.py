"""The replay of a recorded episode as a page holds it.

The same version runs the episode again for it; of other versions the page shows what the record does.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import team_colours
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.drawing.record_frames import radius_of
from lidarium.evaluation.record.episode_record import EpisodeRecord
from lidarium.evaluation.record.replay import drive_again, first_difference, is_same
from lidarium.evaluation.report.page.map_layers import Layer, coarse, grid_around
from lidarium.evaluation.report.page.packing import packed, signed_varints, varints
from lidarium.evaluation.report.page.replay_sampler import ReplaySampler
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN

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
        What it is of, for people.
    text : str
        What `packed` made.
    lacks : str
        Why scans, the truth and own maps are not there; empty where they are.
    """

    title: str
    text: str
    lacks: str = ""


def replay_of(record: EpisodeRecord, floor: str | Floor | None = None) -> Replay:
    """Return the replay of a record.

    Parameters
    ----------
    record : EpisodeRecord
        Of any version.
    floor : str, Floor or None
        The floor, where the one that the record names is not found any more.
    """
    header, display = record.header, record.display
    lacks = ""
    try:
        more, streams = _run_again(record, floor)
    except ValueError as error:
        lacks = printable(str(error))
        more, streams = _as_recorded(record)
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
        **more,
    }
    return Replay(title, packed(about, {**_track(record), **streams}), lacks)


def _title(header: dict[str, Any]) -> str:
    who = header["policy"] or "an unnamed policy"
    seed = "" if header["seed"] is None else f", seed {header['seed']}"
    return printable(f"{who} on {header['floor']}, {header['robots']} robots{seed}")


def _plain(event: dict[str, Any]) -> dict[str, Any]:
    """Return an event whose words can be shown; what JSON has no number for becomes null."""
    shown: dict[str, Any] = {}
    for key, value in event.items():
        is_number = isinstance(value, int | float) and math.isfinite(value)
        shown[printable(str(key))] = value if value is None or is_number else printable(str(value))
    return shown


def _track(record: EpisodeRecord) -> Streams:
    """Return paths and coverage, whose differences are small numbers."""
    display = record.display
    poses = display.poses.reshape(len(display.times), -1, 3).copy()
    poses[..., 2] = np.unwrap(poses[..., 2], axis=0)
    return {
        "pose_times": _differences(display.times, _MILLI),
        "poses": _differences(poses.reshape(len(poses), -1), _MILLI),
        "coverage_times": _differences(display.coverage[:, 0], _MILLI),
        "coverage": _differences(display.coverage[:, 1], _SHARES),
    }


def _differences(values: Any, scale: float) -> bytes:  # noqa: ANN401
    """Return rows of numbers as whole multiples of 1 / scale, each less the row before; column by column."""
    whole = np.rint(np.asarray(values, np.float64) * scale).astype(np.int64)
    return signed_varints(np.diff(whole, axis=0, prepend=0).T)


def _run_again(record: EpisodeRecord, floor: str | Floor | None) -> tuple[dict[str, Any], Streams]:
    sampler = ReplaySampler(float(record.display.times[-1]))
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
    return more, streams


def _grid_header(env: ExplorationEnv, sampler: ReplaySampler) -> dict[str, Any]:
    tables = env.world.floors[0]
    assert tables is not None
    grid = sampler.samples.grid
    return {"grid": grid.header(tables.laser.origin, env.settings.occupancy.resolution)}


def _scans(ranges: NDArray[np.float32]) -> bytes:
    """Return ranges as whole numbers, each less that of the beam before; 0 is no return."""
    whole = np.where(np.isfinite(ranges), np.maximum(np.rint(ranges / SCAN_UNIT_M), 1), 0).astype(np.int64)
    return signed_varints(np.diff(whole, axis=-1, prepend=0))


def _as_recorded(record: EpisodeRecord) -> tuple[dict[str, Any], Streams]:
    display = record.display
    grid = grid_around(display.map_at(math.inf) != UNKNOWN, display.resolution)
    team = Layer.blank(grid)
    for time_s in display.changes.times:
        levels = display.map_at(float(time_s))[grid.window]
        team.add(coarse(levels == OCCUPIED, levels == FREE, grid.block))
    more = {
        "grid": grid.header(display.origin, display.resolution),
        "layers": ["team"],
        "has_truth": False,
        "beam_angles": [],
        "scan_unit_m": SCAN_UNIT_M,
        "has_beliefs": False,
    }
    times = varints([]) if not len(display.changes.times) else _differences(display.changes.times, _MILLI)
    return more, {"map_times": times, "map_team": bytes(team.changes)}
