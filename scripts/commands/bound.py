"""`lidarium bound`: plan how soon a team that has the floor plan could have explored the floor."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tyro.conf import Positional, arg

from lidarium.scripts.common import DONE, NO, Answer, Outputs, TeamCommand, table

OUTPUTS = Outputs(("bound.json", "bound.png"), "bound.json", "longest_m")


@dataclass(frozen=True, kw_only=True)
class _Bound(TeamCommand):
    """Say how soon a team that knew the floor could have seen it.

    Tours past views of the whole floor are planned and driven with the robots' limits. With --out, bound.json
    and a picture are written there. Exit code 3 if no plan sees enough.
    """

    compiles: ClassVar[bool] = True

    floor: Positional[str]
    """name in the catalogue, building:SEED, or a file"""
    robots: Annotated[int, arg()] = 1
    """number of robots"""
    coverage: float = 0.99
    """share of the floor to be seen"""
    rounds: int = 300
    """how often the tours are changed to be shorter"""
    resolution: float | None = None
    """metres per pixel, if the floor is a plain image"""


def execute(command: _Bound) -> Answer:
    """Plan and drive the tours."""
    from lidarium.envs.floors.catalogue.names import load_floor
    from lidarium.envs.settings.making import make_settings
    from lidarium.evaluation.bounds.bound import known_floor_bound
    from lidarium.evaluation.drawing.bound_picture import save_bound_picture
    from lidarium.evaluation.suites.starts import starts_for
    from lidarium.mapping.files.output import write_json

    if command.out is not None:
        OUTPUTS.check(command.out, (command.floor,))
    command.refuse("no policy drives in a bound", "merging", "plans_sparsely", "supervisor")
    if command.rounds < 0:
        raise ValueError(f"rounds is {command.rounds}; want zero or more")
    options = {**command.team_options, "robots": command.robots, "stop_coverage": command.coverage}
    settings = make_settings(**options)
    if settings.stop_coverage != command.coverage:
        raise ValueError(
            f"--set stop_coverage={settings.stop_coverage} sets what --coverage does; want --coverage alone"
        )
    starts = starts_for(command.floor, settings, command.seed, command.resolution)
    floor = load_floor(command.floor, command.resolution)
    found = known_floor_bound(floor, settings, starts, command.rounds, command.seed)
    is_found = math.isfinite(found.time_s)
    result: dict[str, Any] = {
        "floor": command.floor,
        "robots": command.robots,
        "starts": [[round(number, 6) for number in start] for start in starts],
        "coverage": command.coverage,
        "time_s": round(found.time_s, 3) if is_found else None,
        "seen": round(found.share, 6),
        "longest_m": round(found.length_m, 4),
        "total_m": round(found.total_m, 4),
    }
    files = []
    if command.out is not None:
        write_json(command.out / "bound.json", result)
        save_bound_picture(command.out / "bound.png", floor, settings, found, command.floor)
        files = [str(command.out / "bound.json"), str(command.out / "bound.png")]
    time = f"{found.time_s:.1f} s" if is_found else f"none: {100 * found.share:.1f} % were seen"
    facts = [
        ("known floor", f"{100 * command.coverage:g} % in {time}" if is_found else time),
        ("longest tour", f"{found.length_m:.1f} m"),
        ("all tours", f"{found.total_m:.1f} m"),
        *([("files", ", ".join(files))] if files else []),
    ]
    return Answer(result, table(facts), DONE if is_found else NO)
