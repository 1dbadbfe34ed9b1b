"""Communication of a team: connection, data sent, and delay of knowledge.

The delay is the time until each robot has the team's knowledge.

References
----------
Connected share and largest cluster: MAES (Andreasen et al., 2022). Connectivity and C_own: IR2 (Tan et al.,
IROS 2024).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from lidarium.evaluation.metrics.progress import time_to


def largest_clusters(links: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the robots of the largest cluster at each time, shape (times,).

    Robots are in one cluster if links join them.

    Parameters
    ----------
    links : (times, robots, robots) bool
        Whether robot i reaches robot j at each time; a link of either direction joins them.
    """
    sizes = [
        np.bincount(connected_components(csr_array(link), directed=False)[1]).max()
        for link in np.asarray(links, np.bool_)
    ]
    return np.array(sizes, np.int64)


def connected_share(links: NDArray[np.bool_]) -> float:
    """Return the share of times at which all robots are in one cluster (MAES, IR2).

    1 if there is no time.

    Parameters
    ----------
    links : (times, robots, robots) bool
        Links at equal steps of time, as for `largest_clusters`.
    """
    clusters = largest_clusters(links)
    return float((clusters == links.shape[1]).mean()) if clusters.size else 1.0


def largest_cluster_share(links: NDArray[np.bool_]) -> float:
    """Return the mean over time of |largest cluster| / |team|.

    It is MAES's biggest cluster %; 1 if there is no time.

    Parameters
    ----------
    links : (times, robots, robots) bool
        Links at equal steps of time, as for `largest_clusters`.
    """
    clusters = largest_clusters(links)
    return float(clusters.mean()) / links.shape[1] if clusters.size else 1.0


def bytes_per_robot_second(sent: ArrayLike, duration: float) -> float:
    """Return ``sum_i bytes_i / (n T)`` [bytes/s]; 0 if no time passed.

    Parameters
    ----------
    sent : (robots,) int
        Bytes that each robot sent.
    """
    return float(np.mean(np.asarray(sent, np.float64))) / duration if duration > 0.0 else 0.0


def sharing_lag(times: ArrayLike, own: NDArray[np.float64], team: ArrayLike, share: float = 0.99) -> float | None:
    """Return ``T_p(min_i C_own,i) - T_p(C_team)`` [s].

    It is the delay until the last robot has the team's knowledge; None if not reached.

    Parameters
    ----------
    times : (times,) float64
        When [s].
    own : (times, robots) float64
        C_own of each robot.
    team : (times,) float64
        Coverage of the team.
    """
    last, first = time_to(times, own.min(axis=1), share), time_to(times, team, share)
    return None if last is None or first is None else last - first
