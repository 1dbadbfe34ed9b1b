"""Policies under the rules of other projects, compared with the figures that those published.

J. Cao et al., "DARE: diffusion policy for autonomous robot exploration", ICRA 2025, Table I; Y. Cao et al.,
"ARiADNE: a reinforcement learning approach using attention-based deep networks for exploration", ICRA 2023; C. Ho et
al., "MapEx: indoor structure exploration with probabilistic information gain from global map predictions", ICRA 2025.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.evaluation.statistics.estimates import paired_ratio
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.presets import preset_suite
from lidarium.evaluation.suites.suite import Starts, Suite

NODES = ("nearest_node", "utility_node")
WAYPOINTS = ("nearest_frontier", "utility_frontier", "explore_lite", "tour_frontier", "learned", "predicted_tours")
ARIADNE = {"ariadne": "test100", "ariadne_easy": "easy", "ariadne_medium": "medium"}
"""Folder of each of ARiADNE's sets of maps."""

TRUTH = {"truth": {"policy": "predicted_tours", "predictor": "truth"}}
"""Predicted tours with the floor in place of a prediction."""

POLICIES = {
    **dict.fromkeys(("dare", *ARIADNE), (*NODES, *WAYPOINTS, *TRUTH)),
    "mapex": (*WAYPOINTS, "srt"),
}
"""Policies by part; the first is the one that others are compared with."""

TABLE_I = {
    "nearest": (652, 76),
    "utility": (585, 79),
    "NBVP": (645, 109),
    "TARE local": (558, 67),
    "ARiADNE": (579, 82),
    "DARE": (563, 71),
    "near-optimal, on the known map": (499, 61),
}
"""Ways on DARE's 100 maps and their deviations [m], as printed in its Table I."""

MAPEX_OVER_NEAREST = 1.254
"""Coverage of MapEx over that of its nearest frontier on KTH, as printed in its paper."""

PAGE = """# Printed tables

One robot by the rules of other projects: floors, starts, sensors and ends of episodes as in the
[presets](../reference/presets.md), which list the remaining differences.

## DARE

{dare_floors} maps of [DARE](https://github.com/marmotlab/DARE) (MIT). Robots move between nodes 4 m apart and
scan 20 m around at nodes only; an episode ends when no node has utility. Ways are means and standard deviations over
maps. *Over nearest* is the ratio of the printed means; for our policies it is the geometric mean of the ratios to
`nearest_node`, map by map, with a 95 % interval. Compare ratios between the two parts of the table, not ways: the
project's beams leave unknown gaps that robots have to visit. With an exact laser, its own nearest and utility planners
take the ways of `nearest_node` and `utility_node` within 1 %. *Truth*: `predicted_tours` with the floor in place of a
prediction.

| planner | way [m] | over nearest |
|---|---:|---:|
{printed}
{dare}

## ARiADNE

Maps of [ARiADNE](https://github.com/marmotlab/ARiADNE) (MIT), in pixels of 0.1 m. Robots move between nodes and scan
8 m around at nodes only; an episode ends when at most 250 free cells are unseen, or after 128 decisions. Ways over
those of `nearest_node` on the test, easy and medium maps; its paper's figures are not at hand.

{ariadne}

{ariadne_maps}

## MapEx

{mapex_floors} starts on KTH maps of [MapEx](https://github.com/castacks/MapEx) (Clear BSD). Robots drive for 1000 s at
1 m/s and see 20 m far. *Mean coverage* is the mean over an episode. The paper prints coverage {mapex_printed:.3f} of
that of its nearest frontier, with predicted maps. Starts on one map are not independent: intervals are over maps.

| policy | known in the end | mean coverage | over `nearest_frontier` |
|---|---:|---:|---:|
{mapex}
"""


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suites of presets; none without the folder of data."""
    if data is None:
        return {}
    found = {}
    for name, policies in POLICIES.items():
        folder = data / "floorplans" / "ariadne" / ARIADNE.get(name, "")
        floors = tuple(str(path) for path in sorted(folder.glob("*.png"))) if name != "ariadne" else ()
        suite = preset_suite(name.partition("_")[0], NODES + WAYPOINTS, (0,), data, floors)
        own = {policy: settings for policy, settings in TRUTH.items() if policy in policies}
        found[name] = _part(replace(suite, policies=policies, policy_settings=own), every)
    return found


def _part(suite: Suite, every: int) -> Suite:
    """Return every N-th floor, or every N-th start where floors have some."""
    if not suite.starts:
        return replace(suite, floors=suite.floors[::every])
    places = [(floor, start) for floor in suite.floors for start in suite.starts[floor]]
    starts: dict[str, list[Starts]] = {}
    for floor, start in places[::every]:
        starts.setdefault(floor, []).append(start)
    return replace(suite, floors=tuple(starts), starts=starts)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    episodes = {name: by_policy(name, folder / name / EPISODES_FILE) for name in POLICIES}
    return PAGE.format(
        dare_floors=_count(episodes["dare"]),
        mapex_floors=_count(episodes["mapex"]),
        printed=_printed(),
        dare=_dare(episodes["dare"]),
        ariadne=_ariadne(episodes),
        ariadne_maps=in_file(_ariadne_maps(episodes)),
        mapex=_mapex(episodes["mapex"]),
        mapex_printed=MAPEX_OVER_NEAREST,
    )


Episodes = Mapping[str, Mapping[str, Mapping[str, Any]]]
"""Episodes by policy, and by floor and start."""


def by_policy(preset: str, path: Path) -> dict[str, dict[str, Mapping[str, Any]]]:
    """Return the episodes of a preset by policy, those of floors and starts that all policies which ran have."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {policy: {} for policy in POLICIES[preset]}
    for episode in read_episodes(path) if path.exists() else []:
        place = f"{episode['floor']} {episode['starts']}"
        found.setdefault(episode["policy"], {})[place] = episode
    ran = [set(each) for each in found.values() if each]
    common = sorted(set.intersection(*ran)) if ran else []
    return {policy: {place: each[place] for place in common if each} for policy, each in found.items()}


def _printed() -> str:
    nearest = TABLE_I["nearest"][0]
    rows = (
        f"| {planner}, printed | {way} +- {deviation} | {way / nearest:.3f} |"
        for planner, (way, deviation) in TABLE_I.items()
    )
    return "\n".join(rows)


def _dare(ours: Episodes) -> str:
    rows = []
    for policy, episodes in ours.items():
        ways = [_way(each) for each in episodes.values()]
        if ways:
            rows.append(f"| `{policy}` | {np.mean(ways):.0f} +- {np.std(ways):.0f} | {_over(ours, policy, _way)} |")
    return "\n".join(rows) or "| not run | - | - |"


def _ariadne(ours: Mapping[str, Episodes]) -> str:
    """Return the ratios of ways on ARiADNE's sets of maps."""
    rows = []
    for policy in POLICIES["ariadne"]:
        cells = [_over(ours[name], policy, _way) if ours[name][policy] else "-" for name in ARIADNE]
        if any(ours[name][policy] for name in ARIADNE):
            rows.append(f"| `{policy}` | {' | '.join(cells)} |")
    header = [f"| policy | {' | '.join(map(_maps_of, ARIADNE))} |", "|---|---:|---:|---:|"]
    return "\n".join([*header, *(rows or ["| not run | - | - | - |"])])


def _ariadne_maps(ours: Mapping[str, Episodes]) -> str:
    """Return ends, ways and ratios on each of ARiADNE's sets of maps."""
    rows = []
    for name in ARIADNE:
        for policy, episodes in ours[name].items():
            ways = [_way(each) for each in episodes.values()]
            if ways:
                ended = sum(bool(each["success"]) for each in episodes.values())
                cells = f"{ended} of {len(ways)} | {np.mean(ways):.1f} | {_over(ours[name], policy, _way)}"
                rows.append(f"| {_maps_of(name)} | `{policy}` | {cells} |")
    header = ["| maps | policy | ended so | way [m] | over `nearest_node` |", "|---|---|---:|---:|---:|"]
    return "\n".join([*header, *(rows or ["| - | not run | - | - | - |"])])


def _maps_of(name: str) -> str:
    return name.partition("_")[2] or "test"


def _mapex(ours: Episodes) -> str:
    rows = []
    for policy, episodes in ours.items():
        known = [float(each["c_valid_final"]) for each in episodes.values()]
        areas = [_area(each) for each in episodes.values()]
        if known:
            cells = f"{np.mean(known):.3f} | {np.mean(areas):.3f} | {_over(ours, policy, _area)}"
            rows.append(f"| `{policy}` | {cells} |")
    return "\n".join(rows) or "| not run | - | - | - |"


def _count(ours: Episodes) -> int:
    """Return the number of floors and starts that all policies ran from."""
    return len(next(iter(ours.values()), {}))


def _way(episode: Mapping[str, Any]) -> float:
    return float(sum(episode["path_m"]))


def _area(episode: Mapping[str, Any]) -> float:
    return float(episode["auc"])


def _over(ours: Episodes, policy: str, figure: Any) -> str:  # noqa: ANN401
    """Return the ratio of a figure to that of the first policy, as text; starts on one floor are not independent."""
    baseline = next(iter(ours))
    if policy == baseline:
        return "1"
    values, others = ([figure(each) for each in episodes.values()] for episodes in (ours[policy], ours[baseline]))
    floors = [each["floor"] for each in ours[policy].values()]
    return f"{paired_ratio(values, others, clusters=floors):.3f}"


STUDY = Study(page, suites)
