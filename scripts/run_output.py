"""Output of ``lidarium run``: files, its films, and the summary that it prints."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.scripts.common import Outputs, notify, table
from lidarium.scripts.transforms import PlacedMaps, transforms

if TYPE_CHECKING:
    from lidarium.agents.policy import Policy
    from lidarium.agents.report import TeamMaps
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.evaluation.drawing.films import Film, FilmSettings
    from lidarium.evaluation.episodes.runner import Episode
    from lidarium.evaluation.episodes.watching import WatchedExploration
    from lidarium.evaluation.record import Recorder
    from lidarium.mapping.geometry.rigid import Transform


RESULT, RECORD, FILMS = "result.json", "episode.npz", ("run.mp4", "run.gif")
TEAM_FILES = (
    *(f"robot_{number}.{kind}" for number in ("[0-9]", "[0-9][0-9]") for kind in ("yaml", "pgm", "smap")),
    *(f"merged{number}.{kind}" for number in ("", "-[0-9]") for kind in ("yaml", "pgm")),
    "transforms.json",
    "view.png",
    "decisions.jsonl",
)
"""Files that a run writes or not, by its team; those of an earlier run in the same folder go, by exact names."""

OUTPUTS = Outputs((RESULT, RECORD, *FILMS, *TEAM_FILES, "map.yaml", "map.pgm", "run.png"), RESULT, "ended_because")

VIEW_SIZE = 900, 1200
"""Rows and columns of the picture from above [pixels]."""


def write_run(
    folder: Path,
    episode: "Episode",
    result: dict[str, Any],
    recorder: "Recorder | None",
    policy: str,
    films: Sequence[str],
) -> list[str]:
    """Write the figures of a run first, then the record, the maps and the pictures."""
    from lidarium.evaluation.drawing.run_picture import save_run_picture
    from lidarium.evaluation.episodes.events import decision_lines
    from lidarium.evaluation.truth.beliefs import team_log_odds
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.files.output import check_written, write_json, write_text
    from lidarium.mapping.grids.occupancy import three_levels

    env = episode.env
    if old := OUTPUTS.clear(folder, (RECORD, *(film for film in FILMS if film not in films))):
        notify(f"removed files of an earlier run from {folder}: {', '.join(old)}")
    OUTPUTS.clear(folder, TEAM_FILES)
    write_json(folder / RESULT, result)
    if recorder is not None:
        from lidarium.evaluation.record import write_record

        write_record(folder / RECORD, recorder.finish(is_interrupted=episode.is_interrupted))
    log_odds, (x, y) = team_log_odds(env)
    write_ros_map(folder, "map", three_levels(log_odds), (x, y, 0.0), env.settings.occupancy.resolution)
    save_run_picture(folder / "run.png", episode, policy)
    files = [RESULT, "map.yaml", "map.pgm", "run.png", *write_team(folder, episode)]
    if env.settings.camera is not None:
        _save_view(folder / "view.png", episode)
        files += ["view.png", *_write_sparse_maps(folder, episode)]
    files += [*_write_spline_maps(folder, episode), *_write_trees(folder, episode)]
    report = episode.report
    if report.supervision is not None:
        write_text(folder / "decisions.jsonl", decision_lines(report))
        files.append("decisions.jsonl")
    files += [*([RECORD] if recorder is not None else []), *films]
    check_written(folder, files)
    return files


def _save_view(path: Path, episode: "Episode") -> None:
    """Draw the floor from above, with the robots at their final poses."""
    import imageio.v3 as imageio

    from lidarium.envs.drawing.views import views_of
    from lidarium.mapping.files.output import whole_file

    env = episode.env
    assert env.floor is not None
    views = views_of(env.floor, env.settings.robot, env.settings.robots)
    with whole_file(path) as beside:
        imageio.imwrite(beside, views.from_above(env.world.poses, VIEW_SIZE), extension=".png")


def _write_sparse_maps(folder: Path, episode: "Episode") -> list[str]:
    """Write the sparse maps that robots have made, each with a picture of it and of the robot's trail."""
    from lidarium.evaluation.drawing.sparse_picture import save_sparse_pictures
    from lidarium.mapping.sparse.map_files import write_sparse_map

    files = []
    for row, mapper in sorted(episode.env.perception.sparse_maps.made.items()):
        sparse_map = mapper.record
        if sparse_map is not None:
            path = folder / f"{episode.env.possible_agents[row]}.smap"
            write_sparse_map(path, sparse_map)
            pictures = save_sparse_pictures(path, sparse_map.boxes, sparse_map.free, way=mapper.trail)
            files += [path.name, *(Path(picture).name for picture in pictures)]
    return files


def _write_spline_maps(folder: Path, episode: "Episode") -> list[str]:
    """Write the spline maps of localizers on splines, in the frame of their poses, and their pictures."""
    from lidarium.evaluation.drawing.spline_picture import save_spline_picture
    from lidarium.mapping.files.spline_files import write_spline_map
    from lidarium.mapping.localization.on_splines.spline_tracking import SplineTracker

    env, files = episode.env, []
    assert env.floor is not None
    for row, (agent, localizer) in enumerate(zip(env.possible_agents, env.perception.poses.localizers, strict=True)):
        if isinstance(localizer, SplineTracker):
            path = folder / f"{agent}_splines.npz"
            write_spline_map(path, localizer.map)
            on_floor = localizer.map.around(_floor_frame(env, row).inverse(), math.inf)
            save_spline_picture(path.with_suffix(".png"), env.floor, on_floor, title=f"{env.floor.name}: {agent}")
            files += [path.name, path.with_suffix(".png").name]
    return files


def _floor_frame(env: "ExplorationEnv", row: int) -> "Transform":
    """Return the frame of a robot's poses on the floor: that of its true start if it does not know it."""
    from lidarium.mapping.geometry.rigid import Transform

    return Transform() if env.settings.known_starts else Transform(*map(float, env.world.starts[row]))


def _write_trees(folder: Path, episode: "Episode") -> list[str]:
    """Write the trees of safe regions, in the frame of the robots' poses, and their pictures."""
    import numpy as np

    from lidarium.agents.srt.policy import SensorBasedRandomTree
    from lidarium.agents.srt.tree_files import read_tree
    from lidarium.evaluation.drawing.spline_picture import save_spline_picture

    env = episode.env
    if not isinstance(episode.policy, SensorBasedRandomTree):
        return []
    assert env.floor is not None
    names = episode.policy.write_trees(folder)
    for row, name in enumerate(names):
        nodes, frame = read_tree(folder / name).nodes, _floor_frame(env, row)
        places = frame.apply(np.array([node.place for node in nodes]).reshape(-1, 2))
        edges = [(tuple(places[node.parent]), tuple(places[node.number])) for node in nodes if node.parent is not None]
        regions = [frame.apply(node.place + node.safe.outline) for node in nodes]
        picture = (folder / name).with_suffix(".png")
        save_spline_picture(picture, env.floor, None, tree=edges, safe_regions=regions, title=env.floor.name)
    return [*names, *(str(Path(name).with_suffix(".png")) for name in names)]


def write_team(folder: Path, episode: "Episode") -> list[str]:
    """Write each robot's map and, of a team, each group's merged map and ``transforms.json``.

    All are in the robots' own map frames. Merged maps are as the station last knew them; without a station nothing
    is.
    """
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.files.output import write_json

    env, known = episode.env, _team_maps(episode)
    names = []
    for robot, agent in enumerate(env.possible_agents):
        _write_own_map(folder, env, robot)
        names.append(agent)
    for group in known.groups:
        if group.fused is not None:
            joined = sum(name.startswith("merged") for name in names)
            names.append("merged" if joined == 0 else f"merged-{joined + 1}")
            fused = group.fused
            write_ros_map(folder, names[-1], fused.levels, (*fused.origin, 0.0), fused.resolution)
    files = [f"{name}.{kind}" for name in names for kind in ("yaml", "pgm")]
    if env.settings.robots == 1:
        return files
    placed = PlacedMaps([group.frames for group in known.groups], known.pairs, known.corners, known.used, known.dropped)
    write_json(folder / "transforms.json", transforms(placed))
    return [*files, "transforms.json"]


def _write_own_map(folder: Path, env: "ExplorationEnv", robot: int) -> None:
    """Write a robot's own map, in that robot's map frame."""
    import numpy as np

    from lidarium.envs.onboard.station.reports import known_map
    from lidarium.mapping.files.map_files import write_ros_map
    from lidarium.mapping.grids.occupancy import UNKNOWN

    one = known_map(env.perception, robot)
    # A robot that has seen nothing leaves one cell, as a map has to have some.
    levels = one.levels if one.levels.size else np.full((1, 1), UNKNOWN, np.uint8)
    write_ros_map(folder, env.possible_agents[robot], levels, (*one.origin, 0.0), env.settings.occupancy.resolution)


def _team_maps(episode: "Episode") -> "TeamMaps":
    """Return the transforms between the robots' maps: of a station if it exists, otherwise of the robots."""
    from lidarium.agents.report import JoinedGroup, TeamMaps
    from lidarium.envs.faces.merged_maps import true_frames
    from lidarium.mapping.geometry.rigid import Transform

    known, env = episode.policy.team_maps(), episode.env
    if known is not None:
        return known
    first, *others = env.possible_agents
    if not env.settings.known_starts:
        return TeamMaps([JoinedGroup({agent: Transform()}) for agent in env.possible_agents])
    frames = true_frames(env)
    return TeamMaps([JoinedGroup({first: Transform(), **{name: frames[first, name] for name in others}})])


class RunFilms:
    """Films an episode into several files at once, or into none."""

    def __init__(
        self,
        env: "WatchedExploration",
        policy: "Policy",
        names: Sequence[str],
        shown: str,
        settings: "FilmSettings",
    ) -> None:
        from lidarium.evaluation.drawing.films import FILMS

        team = env.settings
        if shown == "auto":
            has_maps = not team.known_starts and team.robots > 1 and team.camera is None
            shown = "maps" if has_maps else "scans"
        elif shown not in FILMS or names:
            check = getattr(FILMS[shown], "check", None)
            if check is not None:
                check(team)
        self._shown = shown
        self._env, self._policy, self._names, self._settings = env, policy, names, settings
        self._open = ExitStack()
        self._films: list[Film] = []
        self._has_begun = False

    @property
    def seconds(self) -> float:
        """Length of the longest film so far [s]."""
        return max((made.writer.seconds for made in self._films), default=0.0)

    def begin(self, folder: Path) -> None:
        """Begin the films, unless they have begun; the policy has been reset."""
        if self._has_begun:
            return

        from lidarium.evaluation.drawing.films import filmed, frames_of

        self._has_begun = True
        for path in (folder / name for name in self._names):
            frames = frames_of(self._shown, self._policy, self._settings.width_of(path))
            made = self._open.enter_context(filmed(path, frames, self._settings))
            made.begin(self._env)
            self._films.append(made)
        self._env.watchers += self._films

    def end(self) -> None:
        """Hold the last pictures for a moment."""
        for made in self._films:
            made.end(self._env)

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Write the films at the end, or no films after an error."""
        with self._open:
            yield
            self._env.watchers[:] = [each for each in self._env.watchers if each not in self._films]


NAMED_GIVEN_UP = 5
"""Maximum number of frontiers given up that are named in the summary.

Result.json has all.
"""

NAMED_JOINS = 10
"""Maximum number of joins that are listed in the summary."""


def run_summary(policy: str, episode: "Episode", result: dict[str, Any], folder: Path, files: list[str]) -> str:
    """Return the summary of an episode as text."""
    env = episode.env
    area = float(env.score.counted[0]) * env.settings.occupancy.resolution**2
    thresholds = [
        f"{share} % at {result[f't{share}_s']:.1f} s" for share in (85, 90, 95, 99) if result[f"t{share}_s"] is not None
    ]
    counted = max(int(env.score.counted[0]), 1)
    ended = [
        (agent, reason or "still at work", f"{length:.1f} m", f"{100.0 * seen / counted:.1f} %")
        for (agent, reason), length, seen in zip(
            result["ended_because"].items(), result["path_m"], env.score.seen, strict=True
        )
    ]
    facts = [
        (
            "explored",
            f"{100.0 * result['coverage_final']:.2f} % of {area:.1f} m2 in {result['time_s']:.1f} s of simulated time",
        ),
        ("reached", ", ".join(thresholds) or "not 85 %"),
        (
            "together",
            f"{sum(result['path_m']):.1f} m driven, overlap {result['overlap']:.2f}, {result['collisions']} collisions",
        ),
        *_among_people(result),
        ("map", f"IoU of occupied cells {result['iou_occupied']:.3f}"),
        ("given up", _given_up(result["given_up"])),
        ("speed", f"{episode.wall_seconds:.1f} s, {result['steps_per_s'] or 0.0:,.0f} steps/s"),
        ("files", f"{folder}: {', '.join(files)}"),
    ]
    how = " (interrupted)" if episode.is_interrupted else ""
    title = f"{result['floor']}: {policy}, seed {result['seed']}, realism {result['realism']}{how}"
    parts = [title, table([*facts, *_of_station(result)])]
    parts += ["", table(ended, ("robot", "ended because", "drove", "saw"))]
    if episode.merges:
        parts += ["", table(_joined(episode), ("joined", "at [s]", "off by [m]", "[deg]"))]
    return "\n".join(parts)


def _among_people(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return a line about people; none without any."""
    if result["closest_approach_m"] is None:
        return []
    return [
        (
            "people",
            f"{result['contacts_by_robot']} contacts by robots, {result['contacts_by_person']} by people, "
            f"{result['near_misses']} near misses, closest {result['closest_approach_m']:.2f} m, "
            f"{result['yielding_s']:.1f} s lost by yielding",
        )
    ]


def _of_station(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return lines about merges and orders of a station; none without one."""
    known, merges = result["supervisor"], result["merges"]
    if known is None:
        return []
    rules = ", ".join(f"{count} by rule {rule}" for rule, count in known["by_rule"].items() if rule != "0")
    pauses = "".join(f", {known[name]} {name}" for name in ("pauses", "resumes") if known[name])
    return [
        (
            "merges",
            f"{known['joined']} joined, {known['dropped']} dropped, {merges['wrong']} wrong by the truth",
        ),
        (
            "orders",
            f"{known['redirections']} redirections{pauses} and {known['stops']} stops of "
            f"{known['decisions']} decisions{f'; {rules}' if rules else ''}",
        ),
    ]


def _joined(episode: "Episode") -> list[tuple[str, ...]]:
    """Return when robots were joined, and how far off by their true starts."""
    from lidarium.evaluation.metrics.merges import transform_error

    rows = []
    for one in episode.merges[:NAMED_JOINS]:
        distance, angle = transform_error(one.found, one.true, one.at)
        rows.append(
            (
                f"{one.a} + {one.b}",
                f"{one.time_s:.1f}",
                f"{distance:.3f}",
                f"{math.degrees(angle):.2f}",
            )
        )
    left = len(episode.merges) - len(rows)
    return [*rows, *([(f"and {left} more",)] if left else [])]


def _given_up(entries: list[dict[str, Any]]) -> str:
    """Name the longest frontiers that were given up, with reason and place."""
    if not entries:
        return "nothing"
    longest = sorted(entries, key=lambda entry: -float(entry["size_m"]))[:NAMED_GIVEN_UP]
    named = ", ".join(
        f"{entry['reason']} at ({entry['x']:.1f}, {entry['y']:.1f}) {entry['size_m']:.2f} m" for entry in longest
    )
    more = len(entries) - len(longest)
    return f"{len(entries)} on the way: {named}{f', and {more} shorter' if more else ''}"
