"""`lidarium drive`: drive a robot by hand in a browser, beside the score of a policy."""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, Suppress, arg

from lidarium.scripts.commands import run
from lidarium.scripts.common import Answer, notify
from lidarium.scripts.options import PORT
from lidarium.scripts.run_output import OUTPUTS, RESULT

if TYPE_CHECKING:
    from lidarium.evaluation.viewing.hand import Times

NAME = "by_hand"
"""Name of such runs in records and results."""

NOBODY = "none"


@dataclass(frozen=True, kw_only=True)
class Drive(run.Run):
    """Drive a robot by hand in a browser, by keys, buttons or clicks on the floor.

    Other robots of the team are driven by a policy, and the score of a policy in the same place stands beside yours.
    Writes what `lidarium run` writes, with a record, from which policies can learn.
    """

    floor: Annotated[Positional[str], arg(metavar="FLOOR")] = "apartment"
    """name in the catalogue, building:SEED, set:NAME, or a file"""
    robots: int = 1
    """number of robots; the first is yours"""
    policy: str | None = "tour_frontier"
    """policy of the other robots; `lidarium show policies` lists them"""
    beside: str = "tour_frontier"
    """policy whose score stands beside yours, of as many robots from the same starts; none for none"""
    record: Suppress[bool] = True
    view: Suppress[bool] = True
    view_port: int = PORT
    """port of the page on this machine, 0 for any that is free"""

    @property
    def chosen_policy(self) -> str:
        """The name that results and files have."""
        return NAME


def execute(command: Drive) -> Answer:
    """Let a person drive until the run ends, and write its results."""
    import lidarium
    from lidarium.agents.by_hand import ByHand
    from lidarium.evaluation.viewing.hand import DrivenView, Hand
    from lidarium.evaluation.viewing.server import address_of, view_server
    from lidarium.scripts.options import check_view

    check_view(command)
    command = replace(command, out=command.out or _next_folder(run.folder_of(command, Path(command.floor).stem)))
    OUTPUTS.check(run.folder_of(command, ""), (command.floor,))
    of_others = command.policy or "tour_frontier"
    others, options = None, run.policy_options_of(command, of_others)
    if command.robots > 1:
        others = lidarium.policy(of_others, **options)
    hand = Hand()
    policy = ByHand(hand, others)
    with view_server(command.view_port) as server:
        beside = None if command.beside == NOBODY else (command.beside, _score(command))
        notify(f"drive robot_0 at {address_of(server)}; Ctrl-C ends the run and keeps what was driven")
        view = DrivenView(server, policy, NAME, hand, beside=beside)
        return run.answer(command, policy, options if others else {}, [view])


def _next_folder(folder: Path) -> Path:
    """Return a folder without a run, since a drive by hand cannot be repeated."""
    numbered = (folder if number == 1 else folder.with_name(f"{folder.name}-{number}") for number in itertools.count(1))
    return next(each for each in numbered if not (each / RESULT).exists())


def _score(command: Drive) -> "Times":
    """Return the times and coverage of the policy that stands beside, in a run from the same starts."""
    import lidarium
    from lidarium.evaluation.episodes.runner import run_episode
    from lidarium.evaluation.episodes.watching import Watcher

    times: list[tuple[float, float]] = []

    class Coverage(Watcher):
        """Keeps the coverage of each step."""

        def step(self, env: Any, commands: Any, /) -> None:  # noqa: ANN401
            times.append((env.scorer.time, env.scorer.coverage))

    policy = lidarium.policy(command.beside)
    env, _ = run.environment(replace(command, policy=command.beside), policy, None)
    env.watchers += [Coverage()]
    notify(f"{command.beside} explores the floor first")
    run_episode(policy, env, command.seed, run.reset_options(command), **command.run_options)
    return times
