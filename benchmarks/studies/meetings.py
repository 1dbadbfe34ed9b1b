"""The study ``meetings``: teams whose radio breaks, that meet, pursue each other, never part, or meet by chance."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from lidarium.agents.catalogue import make_policy
from lidarium.agents.meetings.policy import Meetings
from lidarium.agents.policy import Policy
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.faults import Fault, FaultSettings
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.maps_on_floor import cells_beyond
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.statistics import FEWEST_FOR_INTERVAL, paired_ratio

OURS, POLICIES = "meeting_tours", ("oblivious", "tethered", "meeting_tours")
RULES = ("meeting", "pursuit", "none")

ROBOTS, RADIO, HORIZON_S, SHARE = 4, "signal", 1200.0, 0.99

SEEDS, KINDS = range(3_000_000, 3_000_030), ("office", "building")
"""Floors of the figures: seeds of the set ``test``, large floors and small ones."""

CHOSEN_ON = tuple(f"office:{2_000_000 + k}" for k in range(6))
"""Floors on which the rule was chosen: seeds of the set ``validation``."""

LOST_AT_S = 15.0
"""When the last robot of a team dies, in runs with a lost robot [s]."""

OTHERS = ((2, "signal"), (8, "signal"), (4, "range"), (4, "line_of_sight"))
"""Other teams and radios."""

COLUMNS = (
    *("policy", "robots", "radio", "runs", "reached", "all know [s]"),
    *("team [s]", "station", "station [s]", "apart", "sent [kB]", "told [kB]"),
)
"""Columns of the table of teams."""

RUNS_FILE, RULES_FILE = "runs.jsonl", "rules.jsonl"

PAGE = """# Meetings

Teams of 4 whose radio breaks (`signal` unless said otherwise), maps of 0.1 m, `realism="ideal"`, until every robot
that lives knows {share:.0f} % of the floor, or {horizon:.0f} s, which then count. Ratios are geometric means over
pairs on the same floor, with 95 % intervals. Floors are a part of 60: {offices} offices and {buildings} smaller
buildings.

| figure | to reach | measured | floors | reached |
|---|---:|---:|---:|---|
{goals}

## By floor

| ratio of times | offices | buildings |
|---|---:|---:|
{kinds}

## What can be won

If all robots of `oblivious` had known at once what the team knew together, they would have needed {together} of the
time. With the ideal radio `tour_frontier` needs {ideal} of the time of `oblivious`. Meetings cannot win more.

## By radio and team

*All know*: mean time until every robot knows 99 %; *reached*: runs in which they do. *Team*: until they know it
together. *Station*: share that a listener at the first start holds when all know. *Station [s]*: mean time until it
knows 99 %, and in how many runs. *Apart*: share of the time in which the team was not one cluster. *Told*: cost of
agreements and news, beside the maps that are *sent*; these and *apart* are until all know.

{teams}

## The rule

Rules for a robot that has nothing left to explore, on offices of the set `validation`: time of `meeting_tours` over
that of `oblivious`.

| rule | floors | ratio |
|---|---:|---:|
{rules}
"""


@dataclass(frozen=True, slots=True)
class Run(Task):
    """An episode of a team; its last robot may die, and it may have another rule than the default."""

    policy: str
    floor: str
    robots: int
    radio: str
    lost: str = ""
    rule: str = ""


class _Watch:
    """Notes when all that live know the floor, and when the station does; then it ends the episode.

    Attributes
    ----------
    figures : dict
        Figures of the team when all knew, or of the end.
    """

    def __init__(self, history: History, policy: Policy) -> None:
        self._history, self._policy = history, policy
        self._apart: list[bool] = []
        self.all_know_s: float | None = None
        self.station_s: float | None = None
        self.figures: dict[str, float] = {}

    def __call__(self, env: ExplorationEnv) -> None:
        station = _station_share(env, self._history)
        if self.station_s is None and station >= SHARE:
            self.station_s = env.scorer.time
        if self.all_know_s is None:
            self._note(env, station)
        if self.all_know_s is not None and self.station_s is not None:
            for agent in env.agents:
                env.stop(agent, "all_know")

    def _note(self, env: ExplorationEnv, station: float) -> None:
        lives, sent, policy = env.world.failed == 0, 0, self._policy
        if len(env.perception.exchanges):
            exchange = env.perception.exchanges[0]
            links, sent = exchange.links[np.ix_(lives, lives)], int(exchange.bytes_sent.sum())
            self._apart.append(int(connected_components(links, directed=False)[0]) > 1)
        if self._history.curves.c_own[-1][lives].min() >= SHARE:
            self.all_know_s = env.scorer.time
        told = policy.told_bytes if isinstance(policy, Meetings) else 0
        apart = float(np.mean(self._apart)) if self._apart else 0.0
        self.figures = {"station": station, "apart": apart, "sent": sent, "told": told}


def measure(run: Run) -> dict[str, Any]:
    """Run an episode; return its figures."""
    faults = [Fault(kind="dead_robot", robot=run.robots - 1, at_s=LOST_AT_S)] if run.lost else []
    settings = make_settings(
        robots=run.robots,
        radio=run.radio,
        resolution=0.1,
        realism="ideal",
        starts="fixed",
        horizon_s=HORIZON_S,
        stop_coverage=None,
        faults=FaultSettings(schedule=tuple(faults)),
    )
    history = History()
    env = WatchedExploration(run.floor, settings, watchers=[history])
    policy = make_policy(run.policy, **({"rule": run.rule} if run.rule else {}))
    watch = _Watch(history, policy)
    run_episode(policy, env, 0, on_decision=watch)
    curves = history.curves
    team = np.flatnonzero(curves.c_free >= SHARE)
    return {
        **{name: getattr(run, name) for name in ("policy", "floor", "robots", "radio", "lost", "rule")},
        "all_know_s": watch.all_know_s,
        "team_s": float(curves.times[team[0]]) if len(team) else None,
        "station_s": watch.station_s,
        **watch.figures,
    }


def _station_share(env: ExplorationEnv, history: History) -> float:
    """Return the share of F that the maps that the station holds show to be free."""
    if not env.perception.exchanges:
        return float(history.curves.c_free[-1])
    held = [copy for copy in env.perception.exchanges[0].copies[-1] if copy.size]
    if not held:
        return 0.0
    summed: NDArray[np.int16] = np.sum(np.stack(held), axis=0, dtype=np.int16)
    counted = history.truth.counted
    row, column = cells_beyond(env.simulation, 0, 0)
    return float((summed[row : row + counted.shape[0], column : column + counted.shape[1]] < 0)[counted].mean())


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Run all teams, and the rules that were to be chosen from; every N-th floor."""
    floors = [f"{kind}:{seed}" for seed in SEEDS[::every] for kind in KINDS]
    small = [floor for floor in floors if floor.startswith("building")]
    runs = [Run(policy, floor, ROBOTS, RADIO) for floor in floors for policy in ("oblivious", OURS)]
    runs += [Run(policy, floor, ROBOTS, "all") for floor in small for policy in ("tour_frontier", OURS)]
    runs += [Run(OURS, floor, ROBOTS, RADIO, lost="lost") for floor in small]
    runs += [Run("tethered", floor, ROBOTS, RADIO) for floor in reversed(floors)]
    runs += [Run("meeting_frontier", floor, ROBOTS, RADIO) for floor in small]
    runs += [Run(policy, floor, *other) for floor in small[:10] for other in OTHERS for policy in POLICIES]
    rules = [
        Run(policy, floor, ROBOTS, RADIO, rule=rule)
        for floor in CHOSEN_ON[::every]
        for policy, rule in (("oblivious", ""), *((OURS, rule) for rule in RULES))
    ]
    yield from do_missing(folder / RULES_FILE, "rules", rules, measure, workers)
    yield from do_missing(folder / RUNS_FILE, "runs", runs, measure, workers)


Line = Mapping[str, Any]


def _seconds(line: Line) -> float:
    return HORIZON_S if line["all_know_s"] is None else float(line["all_know_s"])


def _pairs(ours: Sequence[Line], others: Sequence[Line]) -> tuple[list[float], list[float]]:
    """Return the times of two teams on the floors that both have."""
    known = {line["floor"]: _seconds(line) for line in others}
    both = [line for line in ours if line["floor"] in known]
    return [_seconds(line) for line in both], [known[line["floor"]] for line in both]


def _ratio(ours: Sequence[Line], others: Sequence[Line]) -> str:
    """Return the geometric mean of the ratios of times, with its interval if there are enough."""
    times, known = _pairs(ours, others)
    if len(times) < 2:
        return f"{times[0] / known[0]:.3f}" if times else ""
    return f"{paired_ratio(times, known):.3f}"


def _chosen(lines: Sequence[Line], policy: str, radio: str = RADIO, kind: str = "", lost: str = "") -> list[Line]:
    """Return the runs of a policy with the team of the figures."""
    return [
        line
        for line in lines
        if (line["policy"], line["radio"], line["lost"], line["robots"]) == (policy, radio, lost, ROBOTS)
        and line["floor"].startswith(kind)
    ]


def _goals(lines: Sequence[Line]) -> str:
    """Return a row for each figure that was to be reached."""
    rows = []
    for other, radio, goal in (("oblivious", RADIO, 0.80), ("tethered", RADIO, 0.75), ("tour_frontier", "all", 1.03)):
        ours, others = _chosen(lines, OURS, radio), _chosen(lines, other, radio)
        times, known = _pairs(ours, others)
        if times:
            value = float(np.exp(np.mean(np.log(times) - np.log(known))))
            name = f"time of `{OURS}` over `{other}`, radio `{radio}`"
            said = _said(value <= goal, len(times))
            rows.append(f"| {name} | at most {goal} | {_ratio(ours, others)} | {len(times)} | {said} |")
    for lost, name in (("", "runs in which all know"), ("lost", "the same with a robot lost")):
        ours = _chosen(lines, OURS, lost=lost)
        if ours:
            know = sum(line["all_know_s"] is not None for line in ours)
            rows.append(
                f"| {name} | all | {know} of {len(ours)} | {len(ours)} | {_said(know == len(ours), len(ours))} |"
            )
    return "\n".join(rows)


def _said(is_reached: bool, floors: int) -> str:
    """Return whether a figure was reached; few floors do not tell that it was."""
    if not is_reached:
        return "**no**"
    return "yes" if floors >= FEWEST_FOR_INTERVAL else "too few floors"


def _together(lines: Sequence[Line]) -> str:
    """Return the time until the team knows the floor together, over that until all know."""
    known = [line for line in lines if line["team_s"] is not None and line["team_s"] > 0.0]
    if len(known) < 2:
        return f"{known[0]['team_s'] / _seconds(known[0]):.3f}" if known else "-"
    return f"{paired_ratio([line['team_s'] for line in known], [_seconds(line) for line in known]):.3f}"


def _kind_row(lines: Sequence[Line], other: str) -> str:
    ratios = [_ratio(_chosen(lines, OURS, kind=kind), _chosen(lines, other, kind=kind)) for kind in ("office", "build")]
    return f"| `{OURS}` over `{other}` | {ratios[0]} | {ratios[1]} |"


def _team_row(lines: Sequence[Line]) -> str:
    first = lines[0]
    mean: Callable[[str], float] = lambda name: float(np.mean([line[name] for line in lines]))  # noqa: E731
    times = f"{np.mean([_seconds(line) for line in lines]):.0f}"
    together = [HORIZON_S if line["team_s"] is None else line["team_s"] for line in lines]
    team = f"{first['robots']}, one lost" if first["lost"] else str(first["robots"])
    know = sum(line["all_know_s"] is not None for line in lines)
    return (
        f"| `{first['policy']}` | {team} | `{first['radio']}` | {len(lines)} | {know} | {times} | "
        f"{np.mean(together):.0f} | {mean('station'):.3f} | {_station_knows(lines)} | {mean('apart'):.2f} | "
        f"{mean('sent') / 1e3:.0f} | {mean('told') / 1e3:.0f} |"
    )


def _station_knows(lines: Sequence[Line]) -> str:
    """Return the mean time until the station knows the floor over the runs in which it does, and how many they are."""
    times = [line["station_s"] for line in lines if line.get("station_s") is not None]
    return f"{np.mean(times):.0f} ({len(times)})" if times else "- (0)"


def _header(columns: Sequence[str]) -> tuple[str, str]:
    return f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}"


def page(folder: Path) -> str:
    """Return the results as markdown."""
    lines, rules = kept_lines(folder / RUNS_FILE), kept_lines(folder / RULES_FILE)
    teams: dict[tuple[Any, ...], list[Line]] = {}
    for line in lines:
        key = (line["radio"] != RADIO, line["radio"], line["robots"] != ROBOTS, line["robots"], line["lost"])
        teams.setdefault((*key, line["policy"]), []).append(line)
    by_chance = [line for line in rules if line["policy"] == "oblivious"]
    by_rule = {rule: [line for line in rules if line["rule"] == rule] for rule in RULES}
    floors = {line["floor"] for line in _chosen(lines, OURS)}
    return PAGE.format(
        share=100.0 * SHARE,
        horizon=HORIZON_S,
        offices=sum(floor.startswith("office") for floor in floors),
        buildings=sum(floor.startswith("building") for floor in floors),
        goals=_goals(lines),
        together=_together(_chosen(lines, "oblivious")),
        ideal=_ratio(_chosen(lines, "tour_frontier", "all"), _chosen(lines, "oblivious")) or "-",
        kinds="\n".join(_kind_row(lines, other) for other in POLICIES if other != OURS),
        teams=in_file("\n".join([*_header(COLUMNS), *(_team_row(teams[key]) for key in sorted(teams))])),
        rules="\n".join(
            f"| `{rule}` | {len(_pairs(found, by_chance)[0])} | {_ratio(found, by_chance)} |"
            for rule, found in by_rule.items()
            if found
        ),
    )


STUDY = Study(page, work=work, quick=30)
"""The study of meetings."""
