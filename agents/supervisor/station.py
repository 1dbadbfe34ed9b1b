"""The station, which collects reports, merges the robots' maps, and knows how they lie."""

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.report import Join, JoinedGroup, TeamMaps
from lidarium.agents.supervisor.log import StationEvent
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.onboard.radio.messages import OperatingState
from lidarium.envs.onboard.station.joining import team_confirmation
from lidarium.envs.onboard.station.reports import Report
from lidarium.envs.onboard.station.trails import without_bodies, without_own_trail
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.merging.described_map import resampled
from lidarium.mapping.merging.frame_tree import Edge, FrameTree
from lidarium.mapping.merging.fusion import FusedMap, fuse
from lidarium.mapping.merging.incremental import GrowingMap, IncrementalMerger
from lidarium.mapping.merging.joining import Merged, placed
from lidarium.mapping.merging.pair import PairResult
from lidarium.mapping.merging.settings import merge_settings


class _ReceivedReports:
    """The reports of a team: the latest of each robot, and facts from earlier ones.

    Parameters
    ----------
    agents : list of str
        The team.
    resolution : float
        Side of a cell of the robots' maps [m].
    settings : SupervisorSettings
        Definition of enclosed.

    Attributes
    ----------
    latest : dict of str to Report
        The latest of each robot that ever reported.
    """

    def __init__(self, agents: list[str], resolution: float, settings: SupervisorSettings) -> None:
        self._resolution, self._settings = resolution, settings
        self._tracks: dict[str, deque[tuple[float, float]]] = {agent: deque() for agent in agents}
        self._trails: dict[str, list[tuple[float, float]]] = {agent: [] for agent in agents}
        self.latest: dict[str, Report] = {}

    def add(self, agent: str, report: Report) -> None:
        """Take in a report that is newer than all before of its robot."""
        self.latest[agent] = report
        self._trails[agent].append((report.pose.x, report.pose.y))
        track = self._tracks[agent]
        track.append((report.travelled_m, self.known_m2(agent)))
        while len(track) > 1 and track[1][0] <= report.travelled_m - self._settings.enclosed_way_m:
            track.popleft()

    def known_m2(self, agent: str) -> float:
        """Return how much a robot's own map knows [m2], 0 if it never reported."""
        report = self.latest.get(agent)
        return 0.0 if report is None else float(np.count_nonzero(report.map.levels != UNKNOWN)) * self._resolution**2

    def is_enclosed(self, agent: str) -> bool:
        """Whether a robot has mapped too little on the last of its way."""
        track = self._tracks[agent]
        if not track or track[-1][0] - track[0][0] < self._settings.enclosed_way_m:
            return False
        way, gain = (last - first for first, last in zip(track[0], track[-1], strict=True))
        return gain < self._settings.enclosed_gain_m2_per_m * way

    def place(self, agent: str) -> tuple[float, float]:
        """Return the last position of a robot, in its map frame [m]."""
        pose = self.latest[agent].pose
        return pose.x, pose.y

    def trail(self, agent: str) -> NDArray[np.float64]:
        """Return the trail of a robot in its map frame, shape (N, 2) [m]."""
        return np.array(self._trails[agent], np.float64).reshape(-1, 2)

    def is_used(self, agent: str) -> bool:
        """Whether a robot's map is used.

        The robot has reported something, and has not failed (rules 1 and 2).
        """
        report = self.latest.get(agent)
        return (
            report is not None
            and report.state is not OperatingState.FAILED
            and bool((report.map.levels != UNKNOWN).any())
        )


Pair = tuple[str, str]


class MergeStation:
    """The knowledge of the station, from reports alone.

    Parameters
    ----------
    agents : list of str
        The team.
    resolution : float
        Side of a cell of the robots' maps [m].
    radius : float
        Of the robots' bodies [m].
    settings : SupervisorSettings
        How maps are merged and joined.

    Attributes
    ----------
    joins : list of Join
        All transforms that were found, in their order in time.
    events : list of StationEvent
        The events.
    left_behind : list of (str, (N, 2) float64)
        Robots that are to be sent the trail of a failed robot, and that trail in their map frames [m].
    """

    def __init__(
        self,
        agents: list[str],
        resolution: float,
        radius: float,
        settings: SupervisorSettings,
    ) -> None:
        self.agents, self.resolution, self.settings, self._radius = list(agents), resolution, settings, radius
        self._merge_resolution = max(resolution, settings.merge_resolution_m)
        merge = merge_settings(settings.merging, self._merge_resolution)
        if settings.merging == "thesis":
            self._merger = IncrementalMerger(
                self._merge_resolution, merge, searches_per_update=settings.searches_per_merge
            )
        else:
            self._merger = IncrementalMerger(
                self._merge_resolution,
                merge,
                confirmation_growth_m2=settings.confirmation_growth_m2,
                confirmation=team_confirmation(settings.confirmation_own_m2, settings.confirmation_wall_m),
                searches_per_update=settings.searches_per_merge,
            )
        self._merge = merge
        self._tree: FrameTree[str] = FrameTree(merge.cycle_distance_m, merge.cycle_angle)
        self._merged: Merged | None = None
        self._found: set[Pair] = set()
        self._joined: set[Pair] = set()
        self._middles: dict[Pair, tuple[float, float]] = {}
        self._received = _ReceivedReports(self.agents, resolution, settings)
        self.joins: list[Join] = []
        self.events: list[StationEvent] = []
        self.left_behind: list[tuple[str, NDArray[np.float64]]] = []

    @property
    def reports(self) -> dict[str, Report]:
        """The latest report of each robot that ever reported."""
        return self._received.latest

    def known_m2(self, agent: str) -> float:
        """Return how much a robot's own map knows [m2], 0 if it never reported."""
        return self._received.known_m2(agent)

    def is_enclosed(self, agent: str) -> bool:
        """Whether a robot has mapped too little on the last of its way."""
        return self._received.is_enclosed(agent)

    def receive(self, agent: str, report: Report | None, time_s: float) -> None:
        """Take in a report.

        A report older than the last one is dropped, and None counts as no report.
        """
        before = self.reports.get(agent)
        if report is None or report is before:
            return
        if before is not None and report.time_s < before.time_s:
            self._note(time_s, "late", (agent,), f"of {report.time_s:.1f} s, there is one of {before.time_s:.1f} s")
            return
        has_failed = report.state is OperatingState.FAILED and (
            before is None or before.state is not OperatingState.FAILED
        )
        self._received.add(agent, report)
        if has_failed:
            self._note(time_s, "excluded", (agent,), "it has failed; its map is not used any more")
            # With its map goes what showed the others that their images of it, in doorways say, are no walls.
            teammates = [teammate for teammate in self.agents if teammate != agent and self._received.is_used(teammate)]
            frames = {teammate: frame for teammate in teammates if (frame := self.lookup(teammate, agent)) is not None}
            self.left_behind += [
                (teammate, frame.apply(self._received.trail(agent))) for teammate, frame in frames.items()
            ]

    def merge(self, time_s: float, may_search: bool = True) -> None:
        """Merge the maps of all robots that have not failed.

        Known transforms are verified alone if there is no time for searches.
        """
        used = {agent: self.reports[agent] for agent in self.agents if self._received.is_used(agent)}
        if self.settings.trusts_starts:
            self._join_by_starts(used)
        elif used:
            merged = self._merger.update({agent: self._own_map(agent) for agent in used}, may_search=may_search)
            self._tree, self._merged = merged.tree, merged
            self._middles = {
                pair: self._middle(pair, result) for pair, result in merged.pairs.items() if result.is_accepted
            }
            self._note_found(merged, time_s)
        self._note_joins(time_s, used)

    def groups(self) -> list[list[str]]:
        """Return the groups of robots that are joined and have usable maps.

        Each group is in the order of the team.
        """
        groups: list[list[str]] = []
        for agent in self.agents:
            if not self._received.is_used(agent):
                continue
            group = next((one for one in groups if self.lookup(one[0], agent) is not None), None)
            if group is None:
                groups.append([agent])
            else:
                group.append(agent)
        return groups

    def lookup(self, target: str, source: str) -> Transform | None:
        """Return the transform of a robot's map frame into that of another.

        None if they are not joined.
        """
        if target == source:
            return Transform()
        names = self._tree.names
        return self._tree.lookup(target, source) if target in names and source in names else None

    def fused(self, agents: list[str], into: str) -> FusedMap | None:
        """Return the map of some joined robots in the frame of one of their group.

        None if nobody knows anything.
        """
        frames = {
            agent: frame
            for agent in agents
            if self._received.is_used(agent) and (frame := self.lookup(into, agent)) is not None
        }
        if not frames:
            return None
        maps = [self._map_without_bodies(agent) for agent in frames]
        positions = [frame @ placed(one.origin) for one, frame in zip(maps, frames.values(), strict=True)]
        return replace(fuse([one.levels for one in maps], positions, self.resolution), frames=frames)

    def team_maps(self) -> TeamMaps:
        """Return how the maps of all robots lie, with the merged map of each group."""
        grouped = self.groups()
        grouped += [[agent] for agent in self.agents if not any(agent in group for group in grouped)]
        groups = [
            JoinedGroup(
                {agent: frame for agent in group if (frame := self.lookup(group[0], agent)) is not None},
                self.fused(group, group[0]) if len(group) > 1 else None,
            )
            for group in grouped
        ]
        if self._merged is None:
            return TeamMaps(groups)
        return TeamMaps(
            groups,
            self._merged.pairs,
            {name: placed(origin) for name, origin in self._merged.origins.items()},
            *(frozenset((edge.a, edge.b) for edge in edges) for edges in (self._tree.edges, self._tree.dropped)),
        )

    def _own_map(self, agent: str) -> GrowingMap:
        """Return a robot's map as it is compared with others."""
        whole = self.reports[agent].map
        coarse = GrowingMap(resampled(whole.levels, self.resolution, self._merge_resolution), whole.origin)
        # A third robot's image on the one map would contradict the floor on which the other one saw it drive
        # on.
        bare = without_bodies(coarse, self._teammates_trails(agent), self._radius, self._merge_resolution)
        return without_own_trail(bare, self._received.trail(agent), self._radius, self._merge_resolution)

    def _map_without_bodies(self, agent: str) -> GrowingMap:
        """Return a robot's map without the bodies of joined robots.

        Marks of them in its map are removed.
        """
        return without_bodies(self.reports[agent].map, self._teammates_trails(agent), self._radius, self.resolution)

    def _teammates_trails(self, agent: str) -> list[NDArray[np.float64]]:
        """Return the trails of the robots that a robot is joined with, in its map frame [m]."""
        teammates = {
            teammate: frame
            for teammate in self.agents
            if teammate != agent and (frame := self.lookup(agent, teammate)) is not None
        }
        return [frame.apply(self._received.trail(teammate)) for teammate, frame in teammates.items()]

    def _middle(self, pair: Pair, result: PairResult) -> tuple[float, float]:
        """Return the middle of the area known to both maps [m].

        It is in the second robot's map frame.
        """
        x, y = placed(self.reports[pair[1]].map.origin).apply(result.agreement.centre).tolist()
        return x, y

    def _join_by_starts(self, used: Mapping[str, Report]) -> None:
        """Join all robots that know how their frames lie in a common one."""
        known = {agent: report.frame for agent, report in used.items() if report.frame is not None}
        self._tree = FrameTree(self._merge.cycle_distance_m, self._merge.cycle_angle)
        for agent in used:
            self._tree.add_map(agent)
        for a, b in list(zip(known, list(known)[1:], strict=False)):
            self._tree.add_edge(Edge(a, b, known[a].inverse() @ known[b], 1.0))

    def _note_found(self, merged: Merged, time_s: float) -> None:
        """Note pairs that were found and wait to be confirmed."""
        found = {pair for pair, result in merged.pairs.items() if result.is_accepted}
        for a, b in sorted(found - self._found):
            result = merged.pairs[a, b]
            if result.a_from_b is None or self.lookup(a, b) is not None:
                continue
            first, second = (placed(self.reports[name].map.origin) for name in (a, b))
            self.joins.append(
                Join(time_s, a, b, first @ result.a_from_b @ second.inverse(), self._middles[a, b], False)
            )
            self._note(time_s, "found", (a, b), f"{result.agreement.evidence_m:.1f} m of walls speak for it")
        self._found = found

    def _note_joins(self, time_s: float, used: Mapping[str, Report]) -> None:
        """Note which robots have come to be joined, and which are no more."""
        joined = {pair: frame for pair in combinations(used, 2) if (frame := self.lookup(*pair)) is not None}
        for a, b in sorted(self._joined - set(joined)):
            why = "a robot has failed" if not (a in used and b in used) else "the maps contradict it by now"
            self._note(time_s, "dropped", (a, b), why)
        for (a, b), frame in joined.items():
            if (a, b) not in self._joined:
                middle = self._middles.get((a, b), self._received.place(b))
                self.joins.append(Join(time_s, a, b, frame, middle, True, self._tree.has_edge(a, b)))
                self._note(
                    time_s,
                    "joined",
                    (a, b),
                    f"x {frame.x:.2f} m, y {frame.y:.2f} m, theta {frame.theta:.3f} rad",
                )
        self._joined = set(joined)

    def _note(self, time_s: float, event: str, agents: tuple[str, ...], words: str) -> None:
        self.events.append(StationEvent(time_s, event, agents, words))
