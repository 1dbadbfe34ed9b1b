"""Frontiers that robots may choose among, and the results of their choices.

Kernels compute them for the rows of many episodes.

A robot is offered the frontiers that it can come near and see, cheapest path first. A frontier to which it
has driven and turned and that is still there, to which there is no path, or towards which it does not get on,
is given up by name.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.levels.frontier_choices import Choices, Offers, Renewal, ViewReach, renew_teams
from lidarium.envs.levels.frontier_gains import ray_directions
from lidarium.envs.onboard.driving.team_driver import TeamDriver, footprint_of
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import Orders, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.limits import GAINS
from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.work_queue import new_work
from lidarium.mapping.planning.frontiers.approach import default_reach
from lidarium.mapping.planning.search.search_state import disc_spans
from lidarium.mapping.planning.search.swept_costs import SweepMemory

REASONS = ("", "unseen", "blocked", "no_progress")
"""Why a chosen frontier is given up, by number; 0 where it is not."""


_renew_teams_serial = kernel(renew_teams)


_renew_teams_parallel = kernel(parallel=True)(renew_teams)


class FrontierOffers:
    """Offers frontiers to the robots of all episodes, and keeps what they chose.

    Parameters
    ----------
    perception : Perception
        What the robots know.
    settings : ExplorationSettings
        The team of every episode.
    driver : TeamDriver
        Who drives the robots; on the same maps frontiers are searched.

    Attributes
    ----------
    offers : Offers
        What every robot is offered.
    choices : Choices
        What every robot has chosen.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings, driver: TeamDriver) -> None:
        self._perception, self._driver, self._robots = perception, driver, settings.robots
        rows, resolution = settings.robots * perception.world.episodes, settings.occupancy.resolution
        reach = default_reach(footprint_of(settings.robot.radius), resolution) / resolution
        offers, self._memory = settings.frontiers, SweepMemory(len(perception.memory.table))
        self._view = ViewReach(
            disc_spans(reach),
            reach,
            settings.time_step,
            settings.least_frontier,
            round(offers * settings.frontiers_by_size),
            ray_directions(),
            round(settings.lidar.range_max / resolution),
        )
        is_gain_observed = GAINS in settings.observe
        self.offers = Offers(
            np.zeros((rows, offers, 4), np.float32),
            np.zeros((rows, offers + 1), np.int8),
            np.zeros(rows, np.int64),
            np.zeros((rows, offers, 2)),
            np.full((rows, offers), np.nan),
            np.zeros((rows, offers, 2), np.int64),
            np.zeros((rows, offers) if is_gain_observed else (0, 0), np.float32),
        )
        self.choices = Choices(
            np.zeros(rows, np.bool_),
            np.zeros((rows, 2)),
            np.full(rows, np.nan),
            np.zeros((rows, 2), np.int64),
            np.full((rows, 2), -1, np.int64),
            np.zeros((rows, 2)),
            np.zeros(rows),
        )

    def start(self, episode: int = 0) -> None:
        """Begin an episode: nothing is offered or chosen."""
        rows = slice(episode * self._robots, (episode + 1) * self._robots)
        for grid in self._perception.beliefs.log_odds[rows]:
            self._memory.fit(*grid.shape)
        self.offers.counts[rows], self.offers.tables[rows], self.offers.masks[rows] = 0, 0.0, 0
        self.choices.is_chosen[rows], self.choices.tried[rows] = False, -1

    @property
    def observed(self) -> dict[str, NDArray[Any]]:
        """What offers add to observations, arrays over rows by key."""
        offers = self.offers
        gains = {GAINS: offers.gains} if offers.gains.size else {}
        return {"frontiers": offers.tables, "action_mask": offers.masks, **gains}

    def choose(self, rows: NDArray[np.bool_], numbers: NDArray[np.int64]) -> Orders:
        """Take the choices of robots, those named by ``rows`` (rows,).

        Parameters
        ----------
        rows : (rows,) bool
            Who chooses.
        numbers : (rows,) int64
            Number of an offer; any that is not offered lets the robot stay.

        Returns
        -------
        Orders
            What to drive to; robots that do not choose stay.
        """
        offers, choices = self.offers, self.choices
        is_taken = rows & (numbers >= 0) & (numbers < offers.counts)
        taken = np.flatnonzero(is_taken)
        choices.is_chosen[rows] = is_taken[rows]
        choices.targets[taken] = offers.targets[taken, numbers[taken]]
        choices.headings[taken] = offers.headings[taken, numbers[taken]]
        choices.cells[taken] = offers.cells[taken, numbers[taken]]
        return Orders(is_taken, choices.targets, choices.headings)

    def renew(self, is_live: NDArray[np.bool_], is_offered: NDArray[np.bool_]) -> NDArray[np.int8]:
        """Give up what was chosen in vain and offer again.

        Called after the steps of a decision, and at the start.

        Parameters
        ----------
        is_live, is_offered : (rows,) bool
            Whose choices are examined, and who is offered frontiers.

        Returns
        -------
        (rows,) int8
            Why each robot's chosen frontier was given up, by number in ``REASONS``; 0 where it was not.
        """
        reasons = np.zeros(len(is_live), np.int8)
        rows = np.flatnonzero(is_offered | is_live & self.choices.is_chosen)
        episodes = np.unique(rows // self._robots)
        if len(episodes):
            threads = self._perception.threads_for(len(episodes))
            renew = _renew_teams_parallel if threads > 1 else _renew_teams_serial
            renew(
                self._driver.planning(rows, with_frontiers=True),
                self._perception.maps,
                self._driver.drives,
                self._view,
                self.offers,
                self.choices,
                Renewal(is_live, is_offered, reasons, self._memory.table),
                new_work(episodes, threads),
            )
        return reasons

    def target(self, row: int) -> Target:
        """Return the target that a robot chose last."""
        (x, y), heading = self.choices.targets[row], float(self.choices.headings[row])
        return Target(float(x), float(y), None if math.isnan(heading) else heading)

    def why_without_work(self, row: int) -> str:
        """Return why a robot that is offered nothing has nothing to do."""
        navigation = self._perception.planning_map(row, self._driver.shares_map)
        return "frontier_unreachable" if navigation.frontiers.flags.any() else "no_frontier"
