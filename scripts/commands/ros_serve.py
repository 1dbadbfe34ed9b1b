"""`lidarium ros serve`: simulate a team as robots of ROS 2."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from lidarium.scripts.common import Answer, TeamCommand, notify, table
from lidarium.scripts.options import RosOptions, open_graph

if TYPE_CHECKING:
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.ros.graph import Graph
    from lidarium.envs.ros.serving import TeamServer


@dataclass(frozen=True, kw_only=True)
class _RosServe(RosOptions, TeamCommand):
    """Simulate a team as robots of ROS 2 (extra ros).

    Publishes `/clock`, `/tf`, `/tf_static`, `/map`, and of each robot `/robot_0/scan` and `/robot_0/odom`; takes
    `/robot_0/cmd_vel` and `/robot_0/goal_pose` in frame `map`. Other nodes want use_sim_time. Ends at Ctrl-C.
    """

    compiles: ClassVar[bool] = True
    writes: ClassVar[bool] = False

    floor: str = "apartment"
    """name in the catalogue, building:SEED, set:NAME, or a file"""
    robots: int = 3
    """number of robots"""
    starts: Literal["fixed", "drawn"] | None = None
    """start poses: those of the floor, or drawn by the seed"""
    speed: float = 1.0
    """simulated seconds in a second; 0 for as many as possible"""
    waits: bool = False
    """each step waits for a command for each driven robot, and the run ends when all drivers have left"""
    truth: Literal["shown", "aside"] = "shown"
    """whether `/map` and `/tf` have the floor and the true poses; aside, these are `/truth/map` and `/truth/tf`"""
    horizon_s: float | None = None
    """simulated time after which it ends [s]"""
    stop_coverage: float | None = None
    """share of the floor seen at which it ends"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.speed <= 1000.0:
            raise ValueError(f"speed is {self.speed}; want 0 to 1000, 0 for as fast as possible")


def execute(command: _RosServe) -> Answer:
    """Serve until the episode is over, or Ctrl-C."""
    import lidarium
    from lidarium.envs.settings.making import make_settings

    command.refuse("robots are driven from outside", "merging", "plans_sparsely", "supervisor")
    graph = open_graph(command, "lidarium_robots")
    from lidarium.envs.ros.serving import TeamServer

    # The server ends the episode, not the robots: they are driven from outside.
    settings = make_settings(
        robots=command.robots,
        starts=command.starts,
        horizon_s=None,
        stop_coverage=None,
        observe=("velocity",),
        **command.team_options,
    )
    env = lidarium.ExplorationEnv(command.floor, settings)
    env.reset(seed=command.seed)
    server = TeamServer(env, graph, command.truth == "shown")
    notify(f"{command.robots} robots are served in domain {graph.domain} until Ctrl-C")

    def is_over() -> bool:
        horizon, coverage = command.horizon_s, command.stop_coverage
        is_late = horizon is not None and env.time_s >= horizon - 1e-9
        return is_late or (coverage is not None and env.scorer.coverage >= coverage)

    try:
        server.run(command.speed, waits=command.waits, is_over=is_over)
    except KeyboardInterrupt:
        notify("interrupted")
    finally:
        graph.close()
    result = _result(env, server, graph)
    return Answer(result, table([(name, value) for name, value in result.items() if value is not None]))


def _result(env: "ExplorationEnv", server: "TeamServer", graph: "Graph") -> dict[str, Any]:
    scorer = env.scorer
    return {
        "simulated_s": round(scorer.time, 3),
        "coverage": round(scorer.coverage, 6),
        "time_to_99_s": scorer.times.get(0.99),
        **asdict(server.counts),
        "refused": dict(graph.refused),
    }
