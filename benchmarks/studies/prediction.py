"""The study ``prediction``: predicted maps, and what explorers win by them, with the truth as a bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.shared.study import (
    HORIZON_S,
    SETTINGS,
    TEAMS,
    Progress,
    Study,
    Task,
    compared_floors,
    do_missing,
    kept_lines,
)
from lidarium.envs.floors.catalogue.names import SETS, set_floors
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import KINDS, BuildingSettings, generate_building
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.statistics.estimates import paired_ratio
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

TOURS = "tour_frontier"
PREDICTORS = {"predicted": "network", "true": "truth"}
"""Predictors by the names of the policies that use them."""

QUALITY_FILE = "quality.jsonl"

FLOORS = {
    "test": "generated floors of the set `test`",
    "kth": "KTH campus floors",
    "lifull": "LIFULL apartments",
    "slam": "maps that robots made of real buildings",
}
"""Kinds of floors that are explored."""

MAPPED = 24
"""Floors of each family on which predictions are judged."""

COVERAGES = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Maps are judged when a robot has seen so much."""

PAGE = """# Predicted maps

How well the shipped [network](../reference/prediction.md) predicts the unknown part of a map, and how much time
`predicted_tours` saves by it over `tour_frontier`. The truth in place of the prediction bounds the gain of any
predictor. No floor here was trained on.

## Predictions

Maps of one robot with `tour_frontier` that has seen {coverages} of the floor. Counted are the
unknown squares of 0.2 m within 3 m of known ones. *All free* and *nearest* are guesses without a network: all of them
are free; each is as the nearest known square. *Saved*: share of the errors of the better guess that the network
avoids. *Calibration*: expected calibration error.

{quality}

## Times

Simulated time to 99 % of `C_free` over that of `tour_frontier` from the same starts: geometric means with 95 %
intervals. Kobuki, URG-04LX, perfect poses, no noise, maps of 5 cm; misses count with {horizon:.0f} s. The truth has
squares of 0.2 m, as a perfect network would predict.

{times}
"""


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return a suite for each kind of floor."""
    floors = {**compared_floors(data), "test": set_floors("test")}
    return {kind: _suite(floors[kind][::every]) for kind in FLOORS if len(floors.get(kind, ())) >= every}


def _suite(floors: Sequence[str]) -> Suite:
    return Suite(
        policies=(TOURS, *PREDICTORS),
        floors=tuple(floors),
        robots=TEAMS,
        seeds=(0,),
        variants={DEFAULT_VARIANT: SETTINGS},
        policy_settings={
            name: {"policy": "predicted_tours", "predictor": predictor} for name, predictor in PREDICTORS.items()
        },
    )


@dataclass(frozen=True, slots=True)
class Mapped(Task):
    """A floor of a family on which predictions are judged."""

    family: str
    number: int

    @property
    def floor(self) -> str | Floor:
        """The floor."""
        seed = SETS["test"][0] + self.number
        if self.family in KINDS:
            return f"{self.family}:{seed}"
        if self.family.startswith(BARE):
            kind = self.family.removeprefix(BARE)
            return generate_building(seed, BuildingSettings(kind=kind, clutter=0.0))
        return set_floors(self.family)[self.number]


BARE = "bare "
FAMILIES = (*KINDS, *(BARE + kind for kind in KINDS), "home", "dungeon", "robot_map")


def judge(mapped: Mapped) -> dict[str, Any]:
    """Let a robot explore a floor, and count how good predictions of its maps are."""
    from lidarium.mapping.prediction.levels import SIDE
    from lidarium.mapping.prediction.predictors import PartialMap, make_predictor, predicted
    from lidarium.training.prediction.maps import partial_maps
    from lidarium.training.prediction.quality import QualityTally

    maps = partial_maps(mapped.floor, make_settings(**SETTINGS), TOURS, 0, np.array(COVERAGES))
    tally, predictor = QualityTally(), make_predictor("network")
    for levels in maps.levels:
        probability = predicted(predictor, PartialMap(levels, SIDE))
        assert probability is not None
        tally.add(probability, levels, maps.is_free)
    return {"family": mapped.family, "maps": len(maps.levels), "counts": tally.counts}


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Judge predictions on floors of each family."""
    tasks = []
    for family in FAMILIES:
        count = min(MAPPED, len(set_floors(family))) if family in ("home", "dungeon", "robot_map") else MAPPED
        tasks += [Mapped(family, number) for number in range(0, count, every)]
    yield from do_missing(folder / QUALITY_FILE, "maps judged", tasks, judge, workers)


def quality_table(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return errors and calibration by family."""
    from lidarium.training.prediction.quality import QualityTally

    rows = [
        "| floors | maps | squares | wrong | all free | nearest | saved | calibration |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for family in FAMILIES:
        members = [line for line in lines if line["family"] == family]
        if not members:
            continue
        found = QualityTally(np.sum([line["counts"] for line in members], axis=0).tolist()).quality()
        best = min(found.wrong_all_free, found.wrong_nearest)
        shares = [f"{100 * each:.1f} %" for each in (found.wrong, found.wrong_all_free, found.wrong_nearest)]
        saved = f"{100 * (1.0 - found.wrong / best):.0f} %" if best > 0.0 else "-"
        cells = (family, sum(line["maps"] for line in members), f"{found.squares:,}", *shares, saved)
        rows.append("| " + " | ".join(str(each) for each in cells) + f" | {found.calibration:.3f} |")
    return "\n".join(rows)


def times_table(episodes: Mapping[str, Mapping[tuple[str, int], float]], kind: str) -> str:
    """Return the ratios of a kind of floor: policies by floor and size of team."""
    about = FLOORS[kind]
    rows = [
        f"### {about[0].upper()}{about[1:]}\n",
        "| robots | floors | network over tours | faster | truth over tours | faster |",
        "|---:|---:|---:|---:|---:|---:|",
    ]
    for robots in TEAMS:
        pairs = sorted(key for key in episodes.get(TOURS, {}) if key[1] == robots)
        cells: list[str] = []
        for name in PREDICTORS:
            both = [key for key in pairs if key in episodes.get(name, {})]
            if len(both) < 2:
                cells += ["-", "-"]
                continue
            ours, theirs = [episodes[name][key] for key in both], [episodes[TOURS][key] for key in both]
            faster = np.mean(np.array(ours) < np.array(theirs))
            cells += [f"{paired_ratio(ours, theirs):.3f}", f"{100 * faster:.0f} %"]
        rows.append(f"| {robots} | {len(pairs)} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _times_in(folder: Path) -> dict[str, dict[tuple[str, int], float]]:
    """Return the times of a suite by policy, floor and size of team [s]."""
    found: dict[str, dict[tuple[str, int], float]] = {}
    path = folder / EPISODES_FILE
    for episode in read_episodes(path) if path.exists() else []:
        floor = episode[KEY].split(" | ")[1]
        time_s = HORIZON_S if episode["t99_s"] is None else float(episode["t99_s"])
        found.setdefault(episode["policy"], {})[floor, episode["robots"]] = time_s
    return found


def page(folder: Path) -> str:
    """Return the results as markdown."""
    times = {kind: _times_in(folder / kind) for kind in FLOORS}
    return PAGE.format(
        coverages=", ".join(f"{100 * each:.0f}" for each in COVERAGES[:-1]) + f" and {100 * COVERAGES[-1]:.0f} %",
        quality=quality_table(kept_lines(folder / QUALITY_FILE)),
        horizon=HORIZON_S,
        times="\n\n".join(times_table(found, kind) for kind, found in times.items() if found),
    )


STUDY = Study(page, suites, work, quick=100)
