"""`lidarium animate`: what `lidarium run --gif` films, as merging.webp.

It goes with release 0.3.
"""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarium.scripts.common import Answer, Command, Progress, notify, table
from lidarium.scripts.output.run_films import RunFilms
from lidarium.scripts.run import STOP_COVERAGE, TEAM_POLICY, TEAM_WORLD

if TYPE_CHECKING:
    from lidarium.envs.faces.parallel import ExplorationEnv

NAME = "merging.webp"


@dataclass(frozen=True, kw_only=True)
class Animate(Command):
    """Film a supervised team whose robots do not know their starts, as merging.webp.

    `lidarium run --gif` does, with all options of a run: this command goes with release 0.3.
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


def execute(command: Animate) -> Answer:
    """Run an episode and write its film.

    Raises
    ------
    ValueError, FileNotFoundError, OSError
        Where the input or ``--out`` is no good; nothing is written then.
    """
    import lidarium
    from lidarium.envs.settings.making import make_settings
    from lidarium.evaluation.drawing.films.formats import FilmSettings
    from lidarium.evaluation.episodes.output import check_writable
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.episodes.watching import WatchedExploration

    notify("`lidarium animate` goes with release 0.3; `lidarium run --gif` makes this film")
    folder, film_settings = command.out or Path(), FilmSettings(command.speed)
    check_writable(folder)
    options = {"resolution": 0.05, "known_starts": False, "stop_coverage": STOP_COVERAGE, **TEAM_WORLD}
    settings = make_settings(robots=command.robots, horizon_s=command.horizon_s, **options)
    policy, env = lidarium.policy(TEAM_POLICY), WatchedExploration(command.floor, settings)
    films, progress = RunFilms(env, policy, [NAME], "maps", film_settings), Progress(is_quiet=command.json)

    def on_decision(current: "ExplorationEnv") -> None:
        films.begin(folder)
        progress.show(current)

    with closing(progress), films.kept():
        run_episode(policy, env, command.seed, on_decision=on_decision)
        films.end()
    station = policy.report().supervision
    result = {
        "file": str(folder / NAME),
        "film_s": films.seconds,
        "size_bytes": (folder / NAME).stat().st_size,
        "joined_at_s": sorted(
            {round(join.time_s, 6) for join in (station.joins if station else ()) if join.is_used}
        ),
        "coverage_final": round(env.scorer.coverage, 9),
    }
    return Answer(result, table(result.items(), indent=""))
