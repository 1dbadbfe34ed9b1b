"""`lidarium animate`: robots that do not know their starts explore a floor, and their maps become one."""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.scripts.common import Answer, Command, Progress, table
from lidarium.scripts.run import STOP_COVERAGE, TEAM_POLICY, TEAM_WORLD

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidarium.agents.policy import Policy
    from lidarium.envs.drawing.frame_parts import Colour, Frame, View
    from lidarium.envs.exploration import ExplorationEnv
    from lidarium.evaluation.episodes.watching import Watcher

WIDTH, GAP, LINE, TILE = 600, 8, 24, 150
"""Width of the picture, gap between its parts, height of a line, side of a robot's own map [pixels]."""

FRAME_MS, JOIN_MS, LAST_MS = 100, 1800, 2500
"""How long a frame is shown, one in which maps are joined, the last one [ms]."""

JOINED = (13, 148, 136)
"""Colour of joins: red, green, blue."""


@dataclass(frozen=True, kw_only=True)
class Animate(Command):
    """Film a supervised team whose robots do not know their starts, as merging.webp.

    Above are the robots' own maps. Below is the floor with what is known of it, white where maps are joined.
    """

    floor: str = "apartment"
    """name in the catalogue, building:SEED, set:NAME, or a file of any format that the importers know"""
    robots: int = 3
    """number of robots, 2 to 4"""
    horizon_s: float = 300.0
    """simulated time after which the film ends [s]"""
    speed: float = 5.0
    """simulated seconds per second of the film"""

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if not 2 <= self.robots <= 4:
            raise ValueError(f"robots is {self.robots}; want 2 to 4")


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """What is drawn: own maps (sparse), maps on the floor, poses, who is joined, who just now."""

    time_s: float
    coverage: float
    own: list[Any]
    on_floor: "NDArray[Any]"
    believed: "NDArray[Any]"
    poses: "NDArray[Any]"
    groups: list[set[int]]
    joined: list[tuple[int, int]]


def execute(command: Animate) -> Answer:
    """Run an episode and write its film.

    Raises
    ------
    ValueError, FileNotFoundError, OSError
        Where the input or ``--out`` is no good; nothing is written then.
    """
    import imageio.v3 as imageio

    import lidarium
    from lidarium.envs.drawing.frame_parts import view_around
    from lidarium.envs.settings.making import make_settings
    from lidarium.evaluation.drawing.video import check_speed
    from lidarium.evaluation.episodes.output import check_writable, whole_file
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.episodes.watching import WatchedExploration

    path = (command.out or Path()) / "merging.webp"
    check_speed(command.speed)
    check_writable(path.parent)
    options = {"resolution": 0.05, "known_starts": False, "stop_coverage": STOP_COVERAGE, **TEAM_WORLD}
    settings = make_settings(robots=command.robots, horizon_s=command.horizon_s, **options)
    policy, moments = lidarium.policy(TEAM_POLICY), list[Moment]()
    env = WatchedExploration(command.floor, settings)
    env.watchers.append(_camera(policy, moments, FRAME_MS / 1000.0 * command.speed))
    with closing(Progress(is_quiet=command.json)) as progress:
        run_episode(policy, env, command.seed, on_decision=progress.show)
    cell, pairs = settings.occupancy.resolution, zip(moments[-1].own, env.beliefs.origins, strict=True)
    views = [view_around(own.toarray() != 0, (float(x), float(y)), cell, TILE) for own, (x, y) in pairs]
    frames = [_picture(env, moment, views) for moment in moments]
    times = [JOIN_MS if moment.joined else FRAME_MS for moment in moments[:-1]] + [LAST_MS]
    with whole_file(path) as beside:
        imageio.imwrite(beside, frames, plugin="pillow", duration=times, loop=0, quality=60, method=6)
    result = {
        "file": str(path),
        "film_s": sum(times) / 1000.0,
        "size_bytes": path.stat().st_size,
        "joined_at_s": [round(moment.time_s, 6) for moment in moments if moment.joined],
        "coverage_final": round(env.scorer.coverage, 9),
    }
    return Answer(result, table(result.items(), indent=""))


def _camera(policy: "Policy", moments: list[Moment], period_s: float) -> "Watcher":
    """Return what notes moments at equal simulated time, whenever maps are joined, and at the end."""
    from scipy.sparse import csr_array

    from lidarium.evaluation.episodes.watching import Watcher
    from lidarium.evaluation.truth.beliefs import maps_on_floor

    class Camera(Watcher):
        def outcome(self, env: "ExplorationEnv") -> None:
            self.step(env)

        def step(self, env: "ExplorationEnv", commands: Any = None, /) -> None:  # noqa: ANN401
            groups, joined = [{robot} for robot in range(env.settings.robots)], list[tuple[int, int]]()
            since, before = (moments[-1].time_s, moments[-1].groups) if moments else (-1000.0, [])
            station = policy.report().supervision
            for join in () if station is None else station.joins:
                a, b = env.possible_agents.index(join.a), env.possible_agents.index(join.b)
                one, other = (next(group for group in groups if robot in group) for robot in (a, b))
                if join.is_used and one is not other:
                    groups = [each for each in groups if each not in (one, other)] + [one | other]
                    joined += [] if any({a, b} <= group for group in before) else [(a, b)]
            if joined or not env.agents or env.scorer.time + 1e-9 >= since + period_s:
                own = [csr_array(log_odds) for log_odds in env.beliefs.log_odds]
                known = env.scorer.time, env.scorer.coverage, own, maps_on_floor(env)
                poses = env.beliefs.believed.copy(), env.world.poses.copy()
                moments.append(Moment(*known, *poses, groups, joined))

    return Camera()


def _picture(env: "ExplorationEnv", moment: Moment, views: list["View"]) -> "Frame":
    """Draw a moment: the robots' own maps in a row, below them the floor."""
    import cv2
    import numpy as np

    from lidarium.envs.drawing import frame_parts as parts

    colours, width = parts.team_colours(len(views)), (WIDTH - GAP * (len(views) - 1)) // len(views)
    row = np.full((LINE + TILE + GAP, WIDTH, 3), parts.EXPLORED, np.uint8)
    for robot, (view, colour) in enumerate(zip(views, colours, strict=True)):
        lookup = np.array([parts.UNEXPLORED, colour, _pale(colour)], np.uint8)
        cells = np.sign(moment.own[robot].toarray()[view.rows, view.columns])
        drawn, pose = parts.enlarged(lookup[cells], view), moment.believed[robot, None]
        parts.draw_robots(drawn, view, pose, env.settings.robot.radius, [False], [colour])
        tile = row[: LINE + TILE, robot * (width + GAP) : robot * (width + GAP) + width]
        is_joined = any(robot in group and len(group) > 1 for group in moment.groups)
        tile[:LINE], tile[LINE:] = JOINED if is_joined else colour, parts.UNEXPLORED
        up, aside = LINE + (TILE - view.height) // 2, (width - view.width) // 2
        tile[up : up + view.height, aside : aside + view.width] = drawn
        words, place = f"map of robot {robot}{', joined' * is_joined}", (robot * (width + GAP) + 8, 17)
        cv2.putText(row, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.47, parts.EXPLORED, 1, cv2.LINE_AA)
    picture = np.concatenate([row, _floor(env, moment, colours)])
    return parts.with_header(picture, env.floor.name if env.floor else "", moment.coverage, moment.time_s)


def _floor(env: "ExplorationEnv", moment: Moment, colours: list["Colour"]) -> "Frame":
    """Draw the floor: what a robot alone knows in its colour, what is joined in white."""
    import cv2
    import numpy as np

    from lidarium.envs.drawing import frame_parts as parts
    from lidarium.envs.drawing.rendering import view_of

    tables = env.world.floors[0]
    assert tables is not None
    view, solid = view_of(tables, WIDTH), tables.laser.solid
    multiple = round(env.settings.occupancy.resolution / tables.laser.resolution)
    picture = np.array([parts.UNEXPLORED, parts.BACKGROUND], np.float64)[solid[view.rows, view.columns]]
    layers = np.zeros((*picture.shape[:2], 1))
    for group, colour in ((group, colours[min(group)]) for group in moment.groups):
        cells = np.sign(np.sum(moment.on_floor[sorted(group)], axis=0, dtype=np.int16))
        cells = np.kron(cells, np.ones((multiple, multiple), np.int16))[view.rows, view.columns]
        shades = (parts.WALL, parts.EXPLORED) if len(group) > 1 else (colour, _pale(colour))
        shown, is_known = np.array([(0, 0, 0), *shades], np.float64)[cells], (cells != 0)[..., None]
        picture = np.where(is_known, (layers * picture + shown) / (layers + 1.0), picture)
        layers += is_known
    frame = parts.enlarged(picture.astype(np.uint8), view)
    for pair in moment.joined:
        first, last = view.pixels(moment.poses[list(pair), :2]).tolist()
        cv2.line(frame, first, last, JOINED, 4, cv2.LINE_AA, parts.SHIFT)
    parts.draw_robots(frame, view, moment.poses, env.settings.robot.radius, [False] * len(colours), colours)
    for line, (a, b) in enumerate(moment.joined):
        cv2.rectangle(frame, (0, 30 * line), (frame.shape[1], 30 * line + 30), JOINED, -1)
        words, place = f"the station joins the maps of robot {a} and robot {b}", (10, 30 * line + 21)
        cv2.putText(frame, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.6, parts.EXPLORED, 1, cv2.LINE_AA)
    return frame


def _pale(colour: "Colour") -> "Colour":
    """Return a colour mixed with white."""
    red, green, blue = ((channel + 2 * 255) // 3 for channel in colour)
    return red, green, blue
