"""Assignment of goals to many robots.

It weighs the costs of the paths and how little of a goal the others will see anyway.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

NOBODY = -1


def best_goal(costs: NDArray[np.float64], utility: NDArray[np.float64], cost_weight: float) -> int:
    """Return the goal of most utility less cost for one robot.

    It is -1 if none is in reach.

    Parameters
    ----------
    costs : (goals,) float64
        Costs of the ways [m], inf if there is none.
    utility : (goals,) float64
        Values of the goals; -inf for those that are not to be taken.
    cost_weight : float
        Utility that a metre of way costs [1/m].
    """
    # Where there is no weight, a way that does not exist still counts.
    values = np.where(np.isfinite(costs), utility - cost_weight * np.where(np.isfinite(costs), costs, 0.0), -np.inf)
    return int(np.argmax(values)) if len(values) and np.isfinite(values.max()) else NOBODY


def assign_by_cost(costs: NDArray[np.float64]) -> NDArray[np.int64]:
    """Give each robot a goal of its own at the least sum of costs (Kuhn 1955).

    As many robots as possible have a goal.

    Parameters
    ----------
    costs : (robots, goals) float64
        Costs of the ways [m], inf if there is none.

    Returns
    -------
    (robots,) int64
        The goal of each robot, -1 for none.
    """
    goals = np.full(len(costs), NOBODY, np.int64)
    is_way = np.isfinite(costs)
    if not is_way.any():
        return goals
    # Dearer than all ways that there are together: no way is taken only where there is no other.
    none = 1.0 + float(costs[is_way].sum())
    rows, columns = linear_sum_assignment(np.where(is_way, costs, none))
    taken = is_way[rows, columns]
    goals[rows[taken]] = columns[taken]
    return goals


def assign_by_utility(
    costs: NDArray[np.float64], seen: NDArray[np.float64], utility: NDArray[np.float64], cost_weight: float
) -> NDArray[np.int64]:
    """Give robots goals, best pair of robot and goal first.

    The value of goals in view of a taken goal falls.

    After Burgard, Moors, Stachniss, Schneider, Coordinated multi-robot exploration, IEEE T-RO 2005.

    Parameters
    ----------
    costs : (robots, goals) float64
        Costs of the ways [m], inf if there is none.
    seen : (goals, goals) float64
        Share of each goal (second index) that a robot at another (first index) sees anyway, 1 at itself.
    utility : (goals,) float64
        Initial values of the goals.
    cost_weight : float
        Utility that a metre of way costs [1/m].

    Returns
    -------
    (robots,) int64
        The goal of each robot, -1 for none. A goal is taken once.
    """
    goals = np.full(len(costs), NOBODY, np.int64)
    worth = utility.astype(np.float64).copy()
    values = np.where(np.isfinite(costs), -cost_weight * np.where(np.isfinite(costs), costs, 0.0), -np.inf)
    waiting = np.ones(len(costs), np.bool_)
    for _ in range(min(costs.shape)):
        totals = np.where(waiting[:, None], values + worth, -np.inf)
        robot, goal = (int(position) for position in np.unravel_index(np.argmax(totals), totals.shape))
        if not np.isfinite(totals[robot, goal]):
            break
        goals[robot], waiting[robot] = goal, False
        worth -= seen[goal]
        worth[goal] = -np.inf
    return goals
