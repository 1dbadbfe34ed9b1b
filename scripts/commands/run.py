"""`lidarium run`: let a team explore a floor, and write its figures, maps and films."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from lidarium.scripts.commands.floors import verdict_of_reach
from lidarium.scripts.common import (
    DONE,
    DOUBTFUL,
    INTERRUPTED,
    Answer,
    Progress,
    TeamCommand,
    compile_first,
    file_name,
    notify,
)
from lidarium.scripts.options import (
    FilmOptions,
    ViewOptions,
    check_supervised,
    opened_view,
    policy_options,
    supervisor_options,
)
from lidarium.scripts.run_output import OUTPUTS, RunFilms, run_summary, write_run

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lidarium.agents.policy import Policy
    from lidarium.envs.faces.parallel import ExplorationEnv
    from lidarium.envs.settings.exploration import ExplorationSettings
    from lidarium.evaluation.episodes.history import History
    from lidarium.evaluation.episodes.runner import Episode
    from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
    from lidarium.evaluation.record import Recorder

DEFAULT_FOLDER = Path("runs")

LONE_POLICY, TEAM_POLICY = "nearest_frontier", "supervised"
"""Default policies of one robot and of a team."""

TEAM_WORLD: dict[str, Any] = {"noise": "datasheet", "odometry": "typical", "localization": "slam"}
"""Default realism of the world of a team."""

CAMERA = "xtion_tilted"
"""Camera of the robots by default and the policy needs one."""

STOP_COVERAGE = 0.99
"""Share of the floor at which a run without a goal ends."""


@dataclass(frozen=True, kw_only=True)
class Run(FilmOptions, TeamCommand, ViewOptions):
    """Let a team explore a floor.

    Writes its figures, its map, a picture and, if asked for, a record and films.
    """

    compiles: ClassVar[bool] = True

    floor: str = "apartment"
    """name in the catalogue, building:SEED, set:NAME, or a file.

    A file may have any format that the importers know.
    """
    robots: int = 3
    """number of robots"""
    policy: str | None = None
    """policy that decides; `lidarium show policies` lists them; module:Class for one of your own.

    Left out, a team is supervised: it does not know its starts, localizes by SLAM, and merges its maps.
    One robot, or robots with a goal, drive to the nearest frontier as the options say.
    """
    policy_set: tuple[str, ...] = ()
    """settings of the policy as KEY=VALUE, such as weights=FILE of `learned`"""
    resolution: float | None = None
    """metres per pixel, if the floor is a plain image"""
    horizon_s: float | None = None
    """simulated time after which the run is cut [s].

    Without it the run ends when the explorers do
    """
    stop_coverage: float | None = None
    """share of the floor at which the run ends.

    0.99 by default, and none on a floor with a goal or if the policy explores by camera
    """
    starts: str | None = None
    """start poses of the robots: fixed, drawn, or x,y,theta of each.

    In metres and radians, separated by semicolons. Fixed starts are those of the floor, and the default but
    for sets of floors
    """
    record: bool = False
    """write a record of the run, episode.npz.

    `lidarium replay` runs it again to the bit or draws it.
    """
    video: bool = False
    """write a film of the run, run.mp4"""
    gif: bool = False
    """write a film of the run as an animated picture, run.gif"""
    film_shows: str = "auto"
    """content of films, such as maps or scans; `lidarium show films` lists the choices.

    By default maps if robots do not know their starts and have no cameras, otherwise scans
    """

    @property
    def chosen_policy(self) -> str:
        """The policy, by default the nearest frontier."""
        return self.policy or LONE_POLICY

    @property
    def films(self) -> list[str]:
        """Names of the films that are asked for."""
        return ["run.mp4"] * self.video + ["run.gif"] * self.gif


def execute(command: Run) -> Answer:
    """Run one episode and write its results."""
    import lidarium

    command = _completed(command)
    if not command.films:
        command.refuse("no film is asked for", "film_shows", "film_speed", "film_width", "film_fps")
    OUTPUTS.check(folder_of(command, Path(command.floor).stem), (command.floor,))
    options = policy_options_of(command, command.chosen_policy)
    policy = lidarium.policy(command.chosen_policy, **options)
    if "depth" in policy.observes and command.camera is None:
        command = replace(command, camera=CAMERA)
    with opened_view(command, policy, command.chosen_policy) as views:
        return answer(command, policy, options, views)


def answer(command: Run, policy: "Policy", options: dict[str, Any], views: "Sequence[Watcher]") -> Answer:
    """Run the watched episode and write its results."""
    recorder = _recorder(command)
    env, history = environment(command, policy, recorder)
    env.watchers += views
    options_of_reset = reset_options(command)
    films = RunFilms(env, policy, command.films, command.film_shows, command.film_settings)
    compile_first()
    episode = _explore(command, policy, env, films, options_of_reset)
    assert env.floor is not None
    folder = folder_of(command, env.floor.name)
    from lidarium.envs.floors.catalogue.names import describe_reach
    from lidarium.evaluation.episodes.result import result_of

    result = result_of(episode, command.chosen_policy, history)
    if options:
        result["policy_settings"] = options
    reach = describe_reach(env.floor, env.world.starts[0])
    if reach["remark"]:
        is_whole = reach["reachable_m2"] > 0.99 * reach["whole_m2"]
        share = "" if is_whole else f"; {reach['reachable_m2']:.1f} of {reach['whole_m2']:.1f} m2 can"
        notify(f"{env.floor.name}: {reach['remark']}{share}")
        result |= {f"floor_{name}": value for name, value in reach.items()}
    # Starts that were chosen say which area is meant.
    exit_code = verdict_of_reach(reach) if isinstance(options_of_reset.get("starts", ""), str) else DONE
    files = write_run(folder, episode, result, recorder, command.chosen_policy, command.films)
    for name, said in result.get("failed_metrics", {}).items():
        notify(f"{name} failed: {said}")
    return Answer(
        result,
        run_summary(command.chosen_policy, episode, result, folder, files),
        INTERRUPTED if episode.is_interrupted else DOUBTFUL if "failed_metrics" in result else exit_code,
    )


def _completed(command: Run) -> Run:
    """Return a command with its omitted options filled in.

    The policy, and for supervised robots a world in which they need each other's maps.
    """
    from lidarium.envs.floors.floor_choice import FloorChoice

    if command.policy is not None:
        return command
    if command.robots == 1 or FloorChoice(command.floor, command.resolution).has_goal:
        return replace(command, policy=LONE_POLICY)
    team = replace(command, policy=TEAM_POLICY, unknown_starts=True)
    is_realism_given = command.realism != "ideal" or "realism" in command.given
    is_world_given = is_realism_given or any(getattr(command, name) is not None for name in TEAM_WORLD)
    return team if is_world_given else replace(team, **TEAM_WORLD)


def policy_options_of(command: Run, policy: str) -> dict[str, Any]:
    """Return the settings of a policy that a command gives."""
    options = policy_options(command.policy_set)
    if command.supervisor:
        options |= supervisor_options(command.supervisor)
        check_supervised(policy)
    return options


def _settings(command: Run, policy: "Policy") -> "ExplorationSettings":
    from lidarium.agents.policy import settings_for
    from lidarium.envs.floors.floor_choice import FloorChoice
    from lidarium.envs.settings.making import make_settings

    # Coverage is by lasers: a policy that explores by camera ends when cameras have seen all.
    stop, by_laser = command.stop_coverage, "depth" not in policy.observes
    if stop is None and by_laser and not FloorChoice(command.floor, command.resolution).has_goal:
        stop = STOP_COVERAGE
    settings = make_settings(
        robots=command.robots, horizon_s=command.horizon_s, stop_coverage=stop, **command.team_options
    )
    return settings_for(policy, settings)


def _recorder(command: Run) -> "Recorder | None":
    if not command.record:
        return None
    from lidarium.evaluation.record import Recorder

    return Recorder(command.chosen_policy, command.seed, command.floor, command.resolution)


def environment(command: Run, policy: "Policy", recorder: "Recorder | None") -> "tuple[WatchedExploration, History]":
    """Return the environment of a command and what is kept of its metrics over time."""
    from lidarium.evaluation.episodes.history import History
    from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher

    history = History()
    watchers: list[Watcher] = [history] if recorder is None else [history, recorder]
    return WatchedExploration(
        command.floor, _settings(command, policy), image_resolution=command.resolution, watchers=watchers
    ), history


def reset_options(command: Run) -> dict[str, Any]:
    """Return the options of the reset of a command's environment."""
    return {} if command.starts is None else {"starts": _parsed_starts(command.starts, command.robots)}


def _parsed_starts(text: str, robots: int) -> "NDArray[np.float64] | str":
    import numpy as np

    from lidarium.envs.settings.exploration import STARTS

    if text in STARTS:
        return text
    try:
        starts = np.array([[float(value) for value in start.split(",")] for start in text.strip("; ").split(";")])
    except ValueError:
        starts = np.zeros((0, 0))
    if starts.ndim != 2 or starts.shape[1] != 3 or not np.isfinite(starts).all():
        raise ValueError(
            f"--starts is {text!r}; want {', '.join(STARTS)}, or x,y,theta of each robot, separated by "
            "semicolons, as in '1.0,2.5,0;4,2,1.57'"
        )
    if len(starts) != robots:
        raise ValueError(f"--starts has {len(starts)} starts for {robots} robots; want one for each")
    return starts


def _explore(
    command: Run,
    policy: Any,  # noqa: ANN401
    env: "WatchedExploration",
    films: RunFilms,
    options: dict[str, Any],
) -> "Episode":
    """Run the episode under a progress bar and, if asked for, cameras."""
    from lidarium.evaluation.episodes.runner import run_episode

    progress = Progress(is_quiet=command.json)

    def on_decision(current: "ExplorationEnv") -> None:
        # The folder is named by the floor, which a set draws at the reset; nothing is written before that.
        assert current.floor is not None
        films.begin(folder_of(command, current.floor.name))
        progress.show(current)

    with closing(progress), films.kept():
        episode = run_episode(
            policy, env, command.seed, options, on_decision, raise_interrupt=False, **command.run_options
        )
        if not episode.is_interrupted:
            films.end()
    return episode


def folder_of(command: Run, floor: str) -> Path:
    """Return the folder for the files of a run on a floor of a name."""
    return command.out or DEFAULT_FOLDER / file_name(f"{floor}-{command.chosen_policy}-{command.seed}")
