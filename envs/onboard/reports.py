"""What robots report to their station."""

from dataclasses import dataclass

import numpy as np

from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.state import DriveState, OperatingState, Target
from lidarium.mapping.merging.incremental import GrowingMap
from lidarium.mapping.occupancy import three_levels
from lidarium.mapping.rigid import Transform


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """What a robot tells the station. It is of the robot's own belief throughout: positions are in its map frame.

    Attributes
    ----------
    time_s : float
        When it was true [s].
    map : GrowingMap
        Its own map, cut to what is known.
    pose : Transform
        Where it believes to be.
    state : OperatingState
        Whether it takes part in the work.
    drive : DriveState
        What its driving is about.
    target : Target or None
        Where it drives to.
    path_left_m : float
        What is left of its path, 0 without one [m].
    travelled_m : float
        How far it has come by its own odometry [m].
    energy_left_j : float or None
        What is left in its battery; None where it has no limit [J].
    start : Transform
        Where it began.
    frame : Transform or None
        How its map frame lies in one that all robots have in common; None where it does not know, as with unknown starts.
    """

    time_s: float
    map: GrowingMap
    pose: Transform
    state: OperatingState
    drive: DriveState
    target: Target | None
    path_left_m: float
    travelled_m: float
    energy_left_j: float | None
    start: Transform
    frame: Transform | None = None


def known_map(perception: Perception, row: int) -> GrowingMap:
    """Return what a robot's own map knows, cut out."""
    log_odds = perception.own_map(row).log_odds
    row_low, row_high, column_low, column_high = perception.known_window(row)
    cut = three_levels(np.asarray(log_odds[row_low:row_high, column_low:column_high]))
    resolution = perception.settings.occupancy.resolution
    x, y = perception.origin_in_frame(row)
    return GrowingMap(cut, (x + column_low * resolution, y + row_low * resolution))
