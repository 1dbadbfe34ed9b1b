"""Networks beside classic tours, paired, on floors that are not trained on."""

import json
import math
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.learned.network import NO_PREDICTOR
from lidarium.evaluation.suites.campaign import EPISODES_FILE, SUITE_FILE, Campaign
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import MOST_SUITE_BYTES, Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT
from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.output import write_json
from lidarium.training.failures import raise_named
from lidarium.training.progress import Progress
from lidarium.training.settings import TrainingSettings

CLASSIC = "tour_frontier"
"""The policy that networks are compared with, and correct."""


@dataclass(frozen=True, slots=True)
class Validated:
    """How a network does beside classic tours.

    Attributes
    ----------
    ratio : float
        Geometric mean of its times over those of classic tours, episode by episode.
    better : float
        Share of the episodes in which it was faster.
    ended, classic_ended : int
        Episodes that saw enough.
    episodes : int
        Pairs.
    by_robots : dict of float
        The ratio by size of team.
    """

    ratio: float
    better: float
    ended: int
    classic_ended: int
    episodes: int
    by_robots: Mapping[str, float]


def validation_suite(training: TrainingSettings, candidates: Mapping[str, Path]) -> Suite:
    """Return the suite on which networks are compared with classic tours."""
    # Checkpoints do not say on whose maps they were trained.
    predictor = {} if training.predictor == NO_PREDICTOR else {"predictor": training.predictor}
    return Suite(
        policies=(CLASSIC, *candidates),
        floors=training.validation.floors,
        robots=training.validation.robots,
        seeds=(0,),
        variants={DEFAULT_VARIANT: training.options},
        policy_settings={
            name: {"policy": "learned", "weights": str(path.absolute()), **predictor}
            for name, path in candidates.items()
        },
    )


def validate(
    training: TrainingSettings, folder: Path, candidates: Mapping[str, Path], workers: int
) -> Generator[Progress, None, None]:
    """Run missing episodes of classic tours and networks on the validation's floors."""
    suite = validation_suite(training, candidates)
    _follow_move(folder / SUITE_FILE, suite)
    campaign = Campaign(suite, folder, workers, records=False)
    total = sum(1 for _ in suite.trials())
    for _ in campaign.run():
        yield Progress("validation", campaign.done, total)
    if campaign.failures:
        trial, error = campaign.failures[0]
        raise_named(error, f"the episode {trial.key}")


def _follow_move(path: Path, suite: Suite) -> None:
    """Name weights in a kept suite by where they are now.

    The folder of a training may have been moved since; the names in it are still those of the same networks.
    """
    if not path.exists():
        return
    with reading(path, "the suite of a validation", "remove the folder to validate again"):
        kept = json.loads(read_text(path, MOST_SUITE_BYTES))
        moved = {
            name: {**options, **suite.policy_settings.get(name, {})}
            for name, options in kept["policy_settings"].items()
        }
    if moved != kept["policy_settings"]:
        write_json(path, {**kept, "policy_settings": moved})


def compared(folder: Path, name: str, training: TrainingSettings) -> Validated:
    """Return how a network did beside classic tours."""
    team = training.team(1)
    wanted, horizon = team.stop_coverage or 1.0, team.horizon_s or math.inf
    times: dict[str, dict[tuple[Any, ...], float | None]] = {CLASSIC: {}, name: {}}
    for episode in read_episodes(folder / EPISODES_FILE):
        if episode["policy"] in times:
            key = (episode["robots"], episode["floor"], episode["seed"])
            is_enough = episode["coverage_final"] >= wanted - 1e-9
            times[episode["policy"]][key] = episode["time_s"] if is_enough else None
    pairs = sorted(set(times[CLASSIC]) & set(times[name]))
    if not pairs:
        raise ValueError(f"{folder} has no episodes of {name} beside {CLASSIC}; run the training again")
    ours = np.array([_time(times[name][pair], horizon) for pair in pairs])
    theirs = np.array([_time(times[CLASSIC][pair], horizon) for pair in pairs])
    ratios, robots = ours / theirs, np.array([pair[0] for pair in pairs])
    return Validated(
        _mean(ratios),
        float((ours < theirs).mean()),
        sum(times[name][pair] is not None for pair in pairs),
        sum(times[CLASSIC][pair] is not None for pair in pairs),
        len(pairs),
        {str(size): _mean(ratios[robots == size]) for size in np.unique(robots)},
    )


def _time(found: float | None, horizon: float) -> float:
    return horizon if found is None else found


def _mean(ratios: "np.typing.NDArray[np.float64]") -> float:
    """Return the geometric mean."""
    return float(np.exp(np.log(ratios).mean()))
