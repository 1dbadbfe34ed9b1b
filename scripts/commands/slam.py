"""`lidarium slam`: make a map and a trajectory of a recorded log of laser scans."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from tyro.conf import Positional

from lidarium.scripts.common import DONE, DOUBTFUL, Answer, Command, Outputs, counted, notify, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.evaluation.metrics.relations import Relations
    from lidarium.mapping.files.laser_logs import LaserLog
    from lidarium.mapping.localization.on_splines.spline_matches import TrackingSettings
    from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker
    from lidarium.mapping.localization.settings import SlamSettings
    from lidarium.mapping.localization.slam.following import Followed
    from lidarium.mapping.localization.slam.localizer import Slam

    _AnyFollowed = Followed[Slam] | Followed[SplineTracker]

DEFAULT_FOLDER = Path("slam")
FILES = ("map.yaml", "map.pgm", "trajectory.tum", "slam.json")
SPLINES = "splines.npz"
OUTPUTS = Outputs((*FILES, SPLINES), "slam.json", "path_m")
MOST_FAR = 0.05
"""Share of scans that may be too far from the last one for a localizer on splines."""


@dataclass(frozen=True, kw_only=True)
class _Slam(Command):
    """Make a map of a log of laser scans.

    Writes map.yaml, map.pgm, trajectory.tum and slam.json, and splines.npz with a localizer on splines.
    """

    compiles: ClassVar[bool] = True

    log: Positional[Path]
    """CARMEN log, .npz file, bag of ROS 1 or 2, or log of Mines ParisTech.

    CARMEN logs (.log, .clf, also .gz) have FLASER or ROBOTLASER1 lines; .npz holds ranges, stamp and
    pose_odom; bags are .mcap, .db3 or .bag files with LaserScan messages, or folders of these (extra bags);
    logs of Mines are .dat.
    """
    localizer: Literal["slam", "splines", "splines_ekf"] = "slam"
    """matching of scans on grids, or a filter on walls as B-splines, which needs odometry"""
    start_map: Path | None = None
    """spline map to begin with, in the frame of the first pose; of localizers on splines"""
    topic: str | None = None
    """topic of the scans, if a bag has several"""
    resolution: float = 0.05
    """side of a cell of the map [m]"""
    range: float = 30.0
    """longest range that is used [m]"""
    match_distance: float = 0.02
    """motion after which a scan is matched [m]; 0 for every scan"""
    match_angle: float = 1.0
    """or turn after which a scan is matched [degrees]"""
    beam_interval: float = 0.0
    """time from beam to beam if the log does not say [s]; 0 for scans taken at once"""
    field_of_view: float | None = None
    """angle between the first and the last beam of FLASER lines [degrees].

    These lines have no angles; without it the log's parameters count, else those of a SICK
    """
    ignore_odometry: bool = False
    """do without the log's odometry: scans are matched around the last motion"""
    clear_without_return: bool = False
    """a beam without return says that its way is free, as in simulation.

    Otherwise it prints nothing
    """
    reference: Path | None = None
    """true trajectory (TUM); ATE and RPE are computed against it"""
    relations: Path | None = None
    """true motions between pairs of times (Kuemmerle et al. 2009)"""
    clock_shift: float = 0.0
    """shift added to the log's stamps [s].

    For comparing them with the reference's and the relations' stamps.
    """
    relation_poses: Literal["between", "before"] = "between"
    """pose at a relation's time: between the scans around it, or the last before.

    The last one before is for logs that stamp scans with the odometry before.
    """

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        for name, value, least in (
            ("resolution", self.resolution, 1e-3),
            ("range", self.range, 0.1),
            ("match-distance", self.match_distance, 0.0),
            ("match-angle", self.match_angle, 0.0),
            ("beam-interval", self.beam_interval, 0.0),
        ):
            if not (math.isfinite(value) and value >= least):
                raise ValueError(f"{name} is {value}; want at least {least}")
        if self.field_of_view is not None and not 0.0 < self.field_of_view <= 360.0:
            raise ValueError(f"field-of-view is {self.field_of_view} degrees; want more than 0, at most 360")
        if not math.isfinite(self.clock_shift):
            raise ValueError(f"clock-shift is {self.clock_shift} s; want a number")


def execute(command: _Slam) -> Answer:
    """Run SLAM over a log and write the results."""
    from lidarium.mapping.localization.slam.localizer import Slam

    if command.start_map is not None and command.localizer == "slam":
        raise ValueError(f"--start-map is {command.start_map} and the localizer slam; want --localizer splines")
    if command.ignore_odometry and command.localizer != "slam":
        raise ValueError(f"--ignore-odometry is set and the localizer {command.localizer}; want --localizer slam")
    if (ignored := command.given & {"match_distance", "match_angle"}) and command.localizer != "slam":
        option = f"--{min(ignored).replace('_', '-')}"
        raise ValueError(f"{option} is set and the localizer {command.localizer}; want --localizer slam")
    out = command.out or DEFAULT_FOLDER
    OUTPUTS.check(out, (command.log, command.start_map, command.reference, command.relations))
    if command.relations is None:
        command.refuse("there are no --relations", "relation_poses")
        if command.reference is None:
            command.refuse("there is neither --reference nor --relations", "clock_shift")
    log = _log(command)
    reference = None if command.reference is None else _reference(command, log)
    relations = None if command.relations is None else _relations(command, log)

    def watch(scans: Iterable[int]) -> Iterator[int]:
        return counted(scans, len(log.stamps), "scans", command.json)

    followed = _followed(command, log, watch)
    if not len(followed.slam.key_scans.poses):
        raise ValueError(
            f"{command.log} holds no scan with a return within {command.range} m; want a larger --range or another log"
        )
    if not isinstance(followed.slam, Slam):
        doubt = _doubt(log, _tracking(command, log, followed.slam.settings.tracking))
    elif followed.reasons_to_doubt:
        doubt = f"this map is probably wrong: {'; '.join(followed.reasons_to_doubt)}"
    else:
        doubt = None
    if doubt is not None:
        notify(f"{command.log}: {doubt}")
    result = _result(command, log, followed, doubt)
    if reference is not None:
        result |= _against_reference(log, followed.poses, *reference)
    if relations is not None:
        result["relations"] = _against_relations(command, log, followed.poses, relations)
    files = _write(out, log, followed, result)
    return Answer(result, _summary(result, out, files), DONE if doubt is None else DOUBTFUL)


def _followed(command: _Slam, log: "LaserLog", watch: "Callable[[Iterable[int]], Iterable[int]]") -> "_AnyFollowed":
    """Run the localizer that a command asks for over a log."""
    from lidarium.mapping.localization.slam.following import follow, follow_with

    if command.localizer == "slam":
        return follow(log, _settings_of(command), watch)
    return follow_with(_on_splines(command, log), log, watch, seed=command.seed)


def _on_splines(command: _Slam, log: "LaserLog") -> "SplineTracker":
    """Return the localizer on splines that a command asks for."""
    import numpy as np

    from lidarium.mapping.localization.on_splines.spline_ekf import SplineEkf
    from lidarium.mapping.localization.on_splines.spline_filter import SplineFilter

    if log.odometry is None:
        raise ValueError(f"{command.log} has no odometry, which {command.localizer} needs; want --localizer slam")
    if unknown := int((~np.isfinite(log.odometry).all(axis=1)).sum()):
        raise ValueError(
            f"{command.log} has no odometry at {unknown} scans, which {command.localizer} needs; want --localizer slam"
        )
    if command.localizer == "splines":
        of_filter = SplineFilter.Settings()
        return SplineFilter(replace(of_filter, tracking=_tracking(command, log, of_filter.tracking)), log.geometry)
    of_ekf = SplineEkf.Settings()
    return SplineEkf(replace(of_ekf, tracking=_tracking(command, log, of_ekf.tracking)), log.geometry)


def _tracking(command: _Slam, log: "LaserLog", tracking: "TrackingSettings") -> "TrackingSettings":
    """Return the settings of tracking on splines that a command asks for."""
    points = replace(tracking.splines.points, beam_interval_s=log.beam_interval_s)
    return replace(
        tracking,
        splines=replace(tracking.splines, points=points),
        path=replace(tracking.path, submaps=replace(tracking.path.submaps, resolution=command.resolution)),
        start_map="" if command.start_map is None else str(command.start_map),
    )


def _doubt(log: "LaserLog", tracking: "TrackingSettings") -> str | None:
    """Return why the poses of a localizer on splines are probably wrong; None if scans are near to each other."""
    import numpy as np

    assert log.odometry is not None
    steps = np.hypot(*np.diff(log.odometry[:, :2], axis=0).T)
    share = float((steps > tracking.curve_distance).mean()) if len(steps) else 0.0
    if share <= MOST_FAR:
        return None
    return (
        f"{100.0 * share:.0f} % of the scans are more than {tracking.curve_distance:g} m apart, as far as walls are "
        "matched: poses are probably wrong; want --localizer slam"
    )


def _settings_of(command: _Slam) -> "SlamSettings":
    """Return the settings of SLAM that a command asks for."""
    from lidarium.mapping.localization.slam.following import LOG_SETTINGS

    matching = replace(
        LOG_SETTINGS.matching,
        distance_m=command.match_distance,
        angle=math.radians(command.match_angle),
    )
    submaps = replace(LOG_SETTINGS.submaps, resolution=command.resolution)
    return replace(LOG_SETTINGS, uses_odometry=not command.ignore_odometry, matching=matching, submaps=submaps)


def _read(command: _Slam) -> "LaserLog":
    from lidarium.mapping.files.log_files import read_log

    field_of_view = None if command.field_of_view is None else math.radians(command.field_of_view)
    return read_log(command.log, command.topic, field_of_view)


def _log(command: _Slam) -> "LaserLog":
    """Read the log and print the parts left out."""
    log = _read(command)
    if not log.beam_interval_s:
        log = log.swept(command.beam_interval)
    for reason, count in log.skipped.items():
        notify(f"{command.log}: left out: {count} {reason}")
    for remark in log.remarks:
        notify(f"{command.log}: {remark}")
    if log.odometry is None:
        notify(f"{command.log}: there is no odometry; scans are matched around the last motion")
    return log.limited(command.range, command.clear_without_return)


def _result(command: _Slam, log: "LaserLog", followed: "_AnyFollowed", verdict: str | None) -> dict[str, Any]:
    import numpy as np

    from lidarium import __version__

    data_s = float(log.stamps[-1] - log.stamps[0])
    cpu_s = float(followed.scan_s.sum() + followed.finish_s)
    steps = np.diff(followed.poses[:, :2], axis=0)
    slam = followed.slam
    settings = asdict(slam.settings) | {
        "localizer": command.localizer,
        "range_m": command.range,
        "clear_without_return": command.clear_without_return,
    }
    return {
        "log": command.log.name,
        "scans": len(log.stamps),
        "skipped": log.skipped,
        "remarks": [*log.remarks, *([] if verdict is None else [verdict])],
        "probably_wrong": verdict is not None,
        "odometry": not command.ignore_odometry and log.odometry is not None,
        "data_s": round(data_s, 3),
        "cpu_s": round(cpu_s, 3),
        "cpu_over_data": round(cpu_s / data_s, 6) if data_s > 0.0 else None,
        "scan_ms": {
            f"p{percent}": round(1e3 * float(np.percentile(followed.scan_s, percent)), 3) for percent in (50, 95)
        },
        "path_m": round(float(np.hypot(steps[:, 0], steps[:, 1]).sum()), 3),
        **_counts_of(slam),
        "settings": settings,
        "version": __version__,
    }


def _counts_of(slam: "Slam | SplineTracker") -> dict[str, Any]:
    from lidarium.mapping.localization.slam.localizer import Slam

    if isinstance(slam, Slam):
        return {**asdict(slam.counts), "doubtful": [asdict(doubt) for doubt in slam.doubts.stretches]}
    walls = slam.map
    return {
        "updates": slam.updates,
        "closures": slam.closures,
        "corrections": slam.corrections,
        "curves": len(walls.curves),
        "wall_m": round(walls.length, 3),
        "doubtful": [],
    }


def _reference(command: _Slam, log: "LaserLog") -> "tuple[NDArray[np.bool_], NDArray[np.float64]]":
    """Read the true poses: which scans have one, and these poses."""
    from lidarium.mapping.files.trajectories import interpolated, read_tum

    assert command.reference is not None
    stamps, true = read_tum(command.reference)
    times = log.stamps + command.clock_shift
    is_known = (times >= stamps[0]) & (times <= stamps[-1])
    if is_known.sum() < 2:
        raise ValueError(
            f"{command.reference} is from {stamps[0]:.3f} to {stamps[-1]:.3f} s and the log from "
            f"{times[0]:.3f} to {times[-1]:.3f} s; "
            "want times in common (--clock-shift)"
        )
    return is_known, interpolated(stamps, true, times[is_known])


def _against_reference(
    log: "LaserLog", poses: "NDArray[np.float64]", is_known: "NDArray[np.bool_]", known: "NDArray[np.float64]"
) -> dict[str, Any]:
    """Return ATE, and RPE over about a second."""
    import numpy as np

    from lidarium.evaluation.metrics.poses import absolute_error, relative_error

    believed = poses[is_known]
    period = float(np.median(np.diff(log.stamps[is_known])))
    relative = relative_error(believed, known, max(round(1.0 / period), 1) if period > 0.0 else 1)
    return {
        "ate_m": round(absolute_error(believed, known), 6),
        "rpe_m": None if relative is None else round(relative[0], 6),
        "rpe_rad": None if relative is None else round(relative[1], 8),
    }


def _relations(command: _Slam, log: "LaserLog") -> "Relations":
    """Read the relations of times within the log, and count the others.

    The number of the others is reported.
    """
    from lidarium.evaluation.metrics.relations import covered, read_relations

    assert command.relations is not None
    every = read_relations(command.relations)
    try:
        found = covered(every, log.stamps + command.clock_shift)
    except ValueError as error:
        raise ValueError(f"{command.relations}: {error} with --clock-shift, which is {command.clock_shift}") from error
    if len(found.begin) < len(every.begin):
        notify(f"{command.relations}: left out: {len(every.begin) - len(found.begin)} of times beyond the log")
    return found


def _against_relations(
    command: _Slam, log: "LaserLog", poses: "NDArray[np.float64]", relations: "Relations"
) -> dict[str, float]:
    from lidarium.evaluation.metrics.relations import log_relation_errors

    errors = log_relation_errors(log, poses, relations, command.clock_shift, command.relation_poses)
    return {name: round(value, 8) for name, value in errors.as_dict().items()}


def _write(out: Path, log: "LaserLog", followed: "_AnyFollowed", result: dict[str, Any]) -> tuple[str, ...]:
    """Write the results; return the names of the files."""
    from lidarium.mapping.files.map_files import cropped, write_ros_map
    from lidarium.mapping.files.output import check_written, write_json
    from lidarium.mapping.files.spline_files import write_spline_map
    from lidarium.mapping.files.trajectories import write_tum
    from lidarium.mapping.localization.slam.localizer import Slam

    out.mkdir(parents=True, exist_ok=True)
    slam = followed.slam
    files: tuple[str, ...] = FILES
    grid = slam.map if isinstance(slam, Slam) else slam.grid
    OUTPUTS.clear(out)
    write_json(out / "slam.json", result)
    if not isinstance(slam, Slam):
        write_spline_map(out / SPLINES, slam.map)
        files = (*files, SPLINES)
    levels, origin = cropped(grid.levels(), grid.origin, grid.settings.resolution)
    write_ros_map(out, "map", levels, (*origin, 0.0), grid.settings.resolution)
    write_tum(out / "trajectory.tum", log.stamps, followed.poses)
    check_written(out, files)
    return files


def _summary(result: dict[str, Any], out: Path, files: tuple[str, ...]) -> str:
    rows = [
        ("scans", f"{result['scans']:,} over {result['data_s']:.0f} s and {result['path_m']:.0f} m"),
        (
            "CPU time",
            f"{result['cpu_s']:.1f} s, {result['scan_ms']['p50']:.1f} ms a scan (95 %: "
            f"{result['scan_ms']['p95']:.1f} ms)",
        ),
        ("closures", f"{result['closures']} in {result['corrections']} corrections"),
    ]
    if "failures" in result:
        rows.append(("failed matches", f"{result['failures']} of {result['failures'] + result['matches']}"))
    else:
        rows.append(("walls", f"{result['wall_m']:.1f} m in {result['curves']} curves"))
    if result["doubtful"]:
        scans = sum(doubt["scans"] for doubt in result["doubtful"])
        rows.append(("doubtful", f"{scans} scans in {len(result['doubtful'])} stretches, see slam.json"))
        worst = max(result["doubtful"], key=lambda doubt: doubt["scans"])
        rows.append(("longest", f"{worst['start_s']:.3f} to {worst['end_s']:.3f} s: {worst['reason']}"))
    if "ate_m" in result:
        rows.append(("ATE", f"{result['ate_m']:.3f} m"))
    if "relations" in result:
        errors = result["relations"]
        figures = f"{errors['translation_m']:.4f} m, {math.degrees(errors['rotation_rad']):.3f} deg"
        rows.append(("relations", f"{figures} of {errors['relations']}"))
    return "\n".join([table(rows), "", f"written to {out}: {', '.join(files)}"])
