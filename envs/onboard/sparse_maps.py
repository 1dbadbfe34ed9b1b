"""The sparse maps of the robots of all episodes, made from when they are first asked for."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.envs.onboard.sparse_mapping import SparseMapper, sparse_body
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.localization.localizer import KeyScans
from lidarium.mapping.sparse.exploring.ground import ground_map, joined_ground
from lidarium.mapping.sparse.exploring.navigation import SparseNavigation, sparse_navigation

BODY_MARGIN_M = 0.1
"""What is so near to the body of another robot is taken to be that robot [m]."""

HEARD_MARGIN_M = 0.4
"""The same, where it is only known where the other one was when it was heard of [m]."""


class SparseMaps:
    """Sparse maps by row = episode * robots + robot.

    Robots that know each other's starts, and hear each other at once, plan on what all of them know.

    Parameters
    ----------
    simulation : Simulation
        Whose images they are.
    settings : ExplorationSettings
        The team of every episode.
    poses : KnownPoses
        Where the robots know themselves and others to be.
    """

    def __init__(self, simulation: Simulation, settings: ExplorationSettings, poses: KnownPoses) -> None:
        self._simulation, self._settings, self._known_poses = simulation, settings, poses
        self._mappers: dict[int, SparseMapper] = {}
        self._made: dict[tuple[int, int], tuple[tuple[int, ...], SparseNavigation]] = {}
        self._shares = settings.known_starts and settings.robots > 1 and settings.radio.is_ideal

    def start(self, rows: Iterable[int]) -> None:
        """Begin the episode of some rows: nobody has asked for their maps."""
        for row in rows:
            self._mappers.pop(row, None)
            for count in (1, self._settings.robots):
                self._made.pop((row, count), None)

    @property
    def made(self) -> dict[int, SparseMapper]:
        """What makes the maps that were asked for, by row."""
        return dict(self._mappers)

    def check(self) -> None:
        """Check that the robots can make sparse maps.

        Raises
        ------
        ValueError
            Where they have no depth camera, or one that sees no ground.
        """
        SparseMapper(self._settings)

    def of(self, row: int) -> SparseMapper:
        """Return what makes a robot's map; from the first call on, it is made.

        Raises
        ------
        ValueError
            Where the robot has no depth camera, or one that sees no ground.
        """
        mapper = self._mappers.get(row)
        if mapper is None:
            # Robots that share their maps have common axes.
            shared = [self._mappers[each].axes for each in self._sharing(row, True) if each in self._mappers]
            mapper = self._mappers[row] = SparseMapper(self._settings, shared[0] if shared else None)
            self._sense(row, mapper)
        return mapper

    def belief(self, row: int, shares_map: bool = True) -> SparseBelief:
        """Return what a robot knows, in its map frame, up to date.

        Parameters
        ----------
        row : int
            The robot.
        shares_map : bool
            Whether what its teammates know counts, where it reaches the robot at once.
        """
        own = self.of(row)
        sharing = self._sharing(row, shares_map)
        mappers = [self.of(each) for each in sharing]
        versions = tuple(mapper.version for mapper in mappers)
        key = (sharing.start, len(sharing))
        made = self._made.get(key)
        if made is None or made[0] != versions:
            made = self._made[key] = (versions, self._navigation(mappers))
        x, y = self._known_poses.offset(row)
        frame = Transform(-float(x), -float(y)) @ Transform(0.0, 0.0, own.axes or 0.0)
        return SparseBelief(replace(made[1], trail=own.trail), frame, own.ground.camera, own.corrections)

    def sense(self, runs: NDArray[np.bool_] | None = None) -> None:
        """Take in the step that was taken, of all episodes or of those that ``runs`` (episodes,) says."""
        for row, mapper in self._mappers.items():
            is_live = not self._simulation.world.flags[row] & ENDED
            if is_live and (runs is None or runs[row // self._settings.robots]):
                self._sense(row, mapper)

    def correct(self, row: int, scans: KeyScans) -> None:
        """Move a robot's map with the poses of its past, as its localizer believes them now."""
        if row in self._mappers:
            self._mappers[row].correct(scans)

    def _sharing(self, row: int, shares_map: bool) -> range:
        robots = self._settings.robots
        first = row // robots * robots
        return range(first, first + robots) if shares_map and self._shares else range(row, row + 1)

    def _sense(self, row: int, mapper: SparseMapper) -> None:
        camera = self._simulation.camera
        assert camera is not None
        step = int(self._simulation.world.steps[row // self._settings.robots])
        depth = camera.frames[row] if camera.taken_at[row] == step else None
        pose = self._simulation.beliefs.believed[row].copy()
        mapper.sense(step * self._settings.time_step, pose, depth, self._bodies(row))

    def _bodies(self, row: int) -> NDArray[np.float64]:
        """Return where a robot knows others to be, with what may show them around, (K, 3) [m]."""
        known, robots = self._known_poses, self._settings.robots
        if not self._settings.known_starts:
            return np.empty((0, 3))
        margin = BODY_MARGIN_M if known.knows_teammates else HEARD_MARGIN_M
        first, contact = row // robots * robots, self._simulation.beliefs.contact[row]
        return np.array(
            [
                [*known.pose_known_to(row, first + other)[:2], self._settings.robot.radius + margin]
                for other in range(robots)
                if first + other != row and (known.knows_teammates or contact[other])
            ]
        ).reshape(-1, 3)

    def _navigation(self, mappers: list[SparseMapper]) -> SparseNavigation:
        """Return what some robots know together, along the axes that they share."""
        maps = [mapper.map for mapper in mappers if mapper.map is not None]
        boxes = np.concatenate([np.empty((0, 2, 3)), *(each.boxes for each in maps)])
        # Where a robot has been it can drive.
        nodes = np.concatenate([*(mapper.trail for mapper in mappers), *(each.free for each in maps)])
        body, sparse = sparse_body(self._settings), self._settings.sparse_map
        cells, low = joined_ground([mapper.ground for mapper in mappers])
        x, y = (low * sparse.cell_m).tolist()
        ground = ground_map(cells, (x, y), sparse.cell_m, boxes, body)
        return sparse_navigation(nodes, boxes, ground, mappers[0].trail, body, sparse.margin_m)
