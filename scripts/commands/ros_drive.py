"""`lidarium ros drive`: let a policy drive robots of ROS 2."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from lidarium.scripts.common import DONE, DOUBTFUL, INTERRUPTED, Answer, notify, table
from lidarium.scripts.options import RosOptions, check_supervised, open_graph, policy_options, supervisor_options
from lidarium.scripts.run_output import OUTPUTS, RESULT, TEAM_FILES

if TYPE_CHECKING:
    from lidarium.agents.policy import Policy
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.ros.graph import Graph
    from lidarium.envs.ros.maps import Merged
    from lidarium.envs.ros.robots import RobotLink
    from lidarium.envs.ros.world import GivenMap, RosWorld
    from lidarium.envs.settings.exploration import ExplorationSettings
    from lidarium.evaluation.episodes.runner import Episode

DEFAULT_FOLDER = Path("runs") / "ros"

SCAN_PERIOD_S = 0.1
"""Time from scan to scan, if the scans do not state it [s]."""


@dataclass(frozen=True, kw_only=True)
class _RosDrive(RosOptions):
    """Let a policy drive robots of ROS 2: real ones, those of Gazebo, or of `lidarium ros serve` (extra ros).

    Takes scans and odometry, sends commands, and writes the maps and result.json. Robots with maps of their own do not
    know their starts: with the policy `supervised` the maps are merged, and published as `/merged_map`.
    """

    compiles: ClassVar[bool] = True

    policy: str = "nearest_frontier"
    """policy that decides; `lidarium show policies` lists them; module:Class for one of your own"""
    policy_set: tuple[str, ...] = ()
    """settings of the policy as KEY=VALUE"""
    supervisor: tuple[str, ...] = ()
    """settings of the supervisor as KEY=VALUE; --supervisor.KEY VALUE is the same"""
    namespaces: tuple[str, ...] = ("robot_0",)
    """namespaces of the robots, one for each; / for a robot without"""
    transforms: Literal["shared", "own"] = "shared"
    """transforms of all robots on `/tf`, or of each in its namespace, such as `/robot_0/tf`, as nav2 starts teams"""
    robot: str = "kobuki"
    """body and limits of the robots; `lidarium show robots` lists them"""
    localization: Literal["slam", "tf"] = "slam"
    """source of the poses: own SLAM, or the transforms from the frame `map`, which all robots share then"""
    map: bool = False
    """begin with the map of the topic `/map`, if transforms are the source of the poses"""
    sends: Literal["velocities", "goals"] = "velocities"
    """speeds to `cmd_vel` along own paths, or poses to `goal_pose`, as of nav2"""
    stamped: bool = False
    """speeds are of the type TwistStamped"""
    base: str = ""
    """frame of the robot's body; that of the odometry if not given"""
    map_resolution: float = 0.05
    """side of a cell of the maps [m]"""
    extent: float = 40.0
    """side of the area around the starts in which robots may be [m]"""
    horizon_s: float | None = None
    """time after which the robots are stopped [s]; without it they are when the policy ends"""
    timeout_s: float = 10.0
    """time that robots have to be found in [s]"""
    stale_s: float = 0.5
    """age of a scan at which its robot is stopped [s]"""
    lost_s: float = 10.0
    """time without a scan after which a robot is given up [s]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, low, high in (
            ("extent", 4.0, 200.0),
            ("timeout_s", 0.1, 3600.0),
            ("stale_s", 0.05, 60.0),
            ("lost_s", 0.1, 3600.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise ValueError(f"{name} is {getattr(self, name)}; want {low:g} to {high:g}")
        if not self.namespaces or len(set(self.namespaces)) < len(self.namespaces):
            raise ValueError(f"namespaces are {', '.join(self.namespaces)}; want a different one for each robot")
        if self.map and self.localization != "tf":
            raise ValueError("--map is set, and SLAM makes a map of its own; want --localization tf")


def execute(command: _RosDrive) -> Answer:
    """Drive until the policy ends, the time is over, or Ctrl-C; then stop all robots."""
    import lidarium

    out = command.out or DEFAULT_FOLDER
    OUTPUTS.check(out, ())
    options = policy_options(command.policy_set)
    if command.supervisor:
        options |= supervisor_options(command.supervisor)
        check_supervised(command.policy)
    policy = lidarium.policy(command.policy, **options)
    _settings(command, policy)  # refused before robots are looked for
    graph = open_graph(command, "lidarium_driver")
    try:
        episode, world, remarks = _driven(command, policy, graph)
    finally:
        graph.close()
    result = _result(command, episode, world, graph, remarks)
    files = _write(out, episode, result)
    code = INTERRUPTED if episode.is_interrupted else DOUBTFUL if result["remarks"] else DONE
    shown = [(name, value) for name, value in result.items() if value not in (None, [], {})]
    return Answer(result, f"{table(shown)}\n\nwritten to {out}: {', '.join(files)}", code)


def _driven(command: _RosDrive, policy: "Policy", graph: "Graph") -> "tuple[Episode, RosWorld, list[str]]":
    """Find the robots and run the policy on them; returns what is doubtful as well."""
    import numpy as np

    import lidarium
    from lidarium.envs.ros.maps import MapPublisher
    from lidarium.envs.ros.robots import begin_driving, connected, names_of
    from lidarium.envs.ros.world import RosWorld, ground_around, robots_as_backend
    from lidarium.mapping.files.bags.messages import POSE_STAMPED, TWIST, TWIST_STAMPED

    on_map = command.localization == "tf"
    has_own = command.transforms == "own"
    names = [names_of(each, command.base, has_transforms=has_own) for each in command.namespaces]
    links = connected(graph, names, command.timeout_s, on_map=on_map)
    for link in links:
        if link.remark:
            notify(link.remark)
    given = _given_map(command, graph)
    if command.sends == "goals":
        commands = {each.goal: POSE_STAMPED for each in names}
    else:
        commands = {each.command: TWIST_STAMPED if command.stamped else TWIST for each in names}
    unread = begin_driving(graph, commands)
    if unread:
        type_name = commands[unread[0]].rpartition("/")[2]
        other = "" if command.sends == "goals" else f", or {'no ' if command.stamped else ''}--stamped"
        notify(f"nobody reads {', '.join(unread)} as {type_name} yet: want a robot that does{other}")
    # Robots that do not know their starts are somewhere: apart, so that they may begin.
    starts = np.array([link.start() if on_map else (2.0 * k, 0.0, 0.0) for k, link in enumerate(links)])

    def make(settings: "ExplorationSettings") -> RosWorld:
        goals = command.sends == "goals"
        return RosWorld(
            settings,
            links,
            graph,
            is_stamped=command.stamped,
            sends_goals=goals,
            stale_s=command.stale_s,
            lost_s=command.lost_s,
        )

    with robots_as_backend(make) as worlds:
        env = lidarium.ExplorationEnv(ground_around(starts, command.extent), _settings(command, policy, links))
    (world,) = worlds
    world.env, world.given_map = env, given
    maps = MapPublisher(env, world, graph, lambda: _merged(policy))
    remarks: list[str] = []

    def on_decision(_: "ExplorationEnv") -> None:
        maps.publish()
        for topic in commands:
            if graph.publishers(topic) and (remark := f"{topic} has a second driver") not in remarks:
                remarks.append(remark)
                notify(remark)

    notify(f"{len(links)} robots are driven in domain {graph.domain} until the policy ends, or Ctrl-C")
    try:
        episode = lidarium.run_episode(
            policy, env, command.seed, {"starts": starts}, on_decision, raise_interrupt=False
        )
        maps.publish(is_last=True)
    finally:
        env.close()
    return episode, world, remarks


def _given_map(command: _RosDrive, graph: "Graph") -> "GivenMap | None":
    """Return the map of the topic /map, if it is asked for."""
    if not command.map:
        return None
    import time

    from lidarium.envs.ros.world import GivenMap
    from lidarium.mapping.files.bags.messages import GRID

    graph.subscribe("/map", GRID)
    until = time.monotonic() + command.timeout_s
    while time.monotonic() < until:
        for message, *_ in graph.take("/map"):
            return GivenMap(message)
        graph.wait(0.05)
    raise ValueError(f"no map came on /map in domain {graph.domain} within {command.timeout_s:g} s; want a map server")


def _settings(command: _RosDrive, policy: "Policy", links: "Sequence[RobotLink]" = ()) -> "ExplorationSettings":
    """Return the settings of a team of robots with such lasers; those of a simulated team if there are no links yet."""
    from dataclasses import asdict

    from lidarium.agents.policy import settings_for
    from lidarium.envs.ros.world import BACKEND
    from lidarium.envs.settings.lidar import Lidar
    from lidarium.envs.settings.making import make_settings

    lidar, period = Lidar(), 0.0
    if links:
        assert links[0].geometry is not None
        lidar, period = Lidar(**asdict(links[0].geometry)), links[0].scan_period_s
    on_map = command.localization == "tf"
    settings = make_settings(
        robots=len(command.namespaces),
        robot=command.robot,
        lidar=lidar,
        backend=BACKEND if links else "kinematic",
        localization="truth" if on_map else "slam",
        known_starts=on_map,
        time_step=period if 0.01 <= period <= 1.0 else SCAN_PERIOD_S,
        horizon_s=command.horizon_s,
        stop_coverage=None,
        resolution=command.map_resolution,
        raster_resolution=command.map_resolution,
    )
    return settings_for(policy, settings)


def _merged(policy: "Policy") -> "Merged | None":
    """Return the largest merged map that a policy's station knows."""
    known = policy.team_maps()
    groups = [] if known is None else [group for group in known.groups if group.fused is not None]
    if not groups:
        return None
    largest = max(groups, key=lambda group: len(group.frames))
    assert largest.fused is not None
    return dict(largest.frames), largest.fused


def _result(
    command: _RosDrive, episode: "Episode", world: "RosWorld", graph: "Graph", remarks: list[str]
) -> dict[str, Any]:
    """Return what is known of a run; there is no truth, so that nothing is scored."""
    from lidarium import __version__
    from lidarium.envs.onboard.station.reports import known_map
    from lidarium.mapping.grids.occupancy import FREE

    env = episode.env
    agents, side = env.possible_agents, env.settings.occupancy.resolution
    lost = [agent for agent, failed in zip(agents, world.failed, strict=True) if failed]
    merged = _merged(episode.policy)
    maps = [known_map(env.perception, row).levels for row in range(len(agents))]
    return {
        "policy": command.policy,
        "seed": command.seed,
        "domain": graph.domain,
        "robots": {agent: link.names.scan for agent, link in zip(agents, world.links, strict=True)},
        "time_s": round(env.time_s, 3),
        "wall_s": round(episode.wall_seconds, 3),
        "free_m2": {
            agent: round(float((own == FREE).sum()) * side**2, 2) for agent, own in zip(agents, maps, strict=True)
        },
        "merged_free_m2": None if merged is None else round(float((merged[1].levels == FREE).sum()) * side**2, 2),
        "travelled_m": {agent: round(float(way), 2) for agent, way in zip(agents, world.travelled, strict=True)},
        "ended_because": dict(env.scorer.ended_because),
        "stale_steps": world.stale_steps,
        "refused": dict(graph.refused),
        "remarks": [*remarks, *(f"{agent} fell silent and was given up" for agent in lost)],
        "is_interrupted": episode.is_interrupted,
        "version": __version__,
    }


def _write(out: Path, episode: "Episode", result: dict[str, Any]) -> list[str]:
    from lidarium.mapping.files.output import check_written, write_json
    from lidarium.scripts.run_output import write_team

    out.mkdir(parents=True, exist_ok=True)
    OUTPUTS.clear(out, TEAM_FILES)
    write_json(out / RESULT, result)
    files = [RESULT, *write_team(out, episode)]
    check_written(out, files)
    return files
