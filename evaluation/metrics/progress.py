"""Time, decisions, distance, collisions and memory: how a team gets to a share of the floor, and its cost.

Runs that do not reach a share are censored, not dropped. Time is simulated time. Coverage over time is a step
function: each value holds until the next.

References
----------
T_p: Xu et al., Explore-Bench (ICRA 2022), which takes wall time. D_p as the longest path of the team: MARVEL
(Chiun et al., ICRA 2025) and IR2 (Tan et al., IROS 2024). N_p: decision steps as of IR2. AUC: as of MAexp's
curves (Zhu et al., ICRA 2024). Restricted time: Royston and Parmar, Restricted mean survival time (BMC
Medical Research Methodology, 2013). Balance: Explore-Bench, "std". Jain index: Jain, Chiu and Hawe, A
quantitative measure of fairness (1984).
"""

import math
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray


def _first_reached(coverage: ArrayLike, share: float) -> int | None:
    """Return the index of the first coverage that is at least ``share``.

    None without a value.

    Parameters
    ----------
    coverage : (times,) float64
        Coverage in the order of time.
    """
    reached = np.flatnonzero(np.asarray(coverage, np.float64) >= share)
    return int(reached[0]) if reached.size else None


def time_to(times: ArrayLike, coverage: ArrayLike, share: float) -> float | None:
    """Return ``T_p`` = min{t : C_free(t) >= p} [s], None if it is not reached.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    """
    k = _first_reached(coverage, share)
    return None if k is None else float(np.asarray(times, np.float64)[k])


def decisions_to(decisions: ArrayLike, coverage: ArrayLike, share: float) -> int | None:
    """Return ``N_p``, the decisions taken until C_free >= p.

    The one in progress is included; None if p is not reached.

    Parameters
    ----------
    decisions : (times,) int
        Decisions taken until each time.
    coverage : (times,) float64
        Coverage at these times.
    """
    k = _first_reached(coverage, share)
    return None if k is None else int(np.asarray(decisions)[k])


def distance_to(lengths: NDArray[np.float64], coverage: ArrayLike, share: float) -> float | None:
    """Return ``D_p`` = max_i L_i(T_p), the longest path of the team [m].

    It is taken when C_free >= p first; None if p is not reached.

    Parameters
    ----------
    lengths : (times, robots) float64
        Length of each robot's path until each time [m].
    coverage : (times,) float64
        Coverage at these times.
    """
    k = _first_reached(coverage, share)
    return None if k is None else float(lengths[k].max())


def distance_sum_to(lengths: NDArray[np.float64], coverage: ArrayLike, share: float) -> float | None:
    """Return ``D_sum,p`` = sum_i L_i(T_p), the path length of the whole team [m].

    It is taken when C_free >= p first; as `distance_to`.
    """
    k = _first_reached(coverage, share)
    return None if k is None else float(lengths[k].sum())


def is_success(times: ArrayLike, coverage: ArrayLike, share: float, horizon: float | None) -> bool:
    """Return whether ``T_p <= H``.

    The coverage that stops a run was then reached within the horizon.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    """
    reached = time_to(times, coverage, share)
    # Times are whole numbers of steps: a horizon that is not must not lose its last step to rounding.
    return reached is not None and (horizon is None or reached <= horizon + 1e-9)


def area_under_curve(times: ArrayLike, coverage: ArrayLike, horizon: float) -> float:
    """Return ``AUC = (1 / H) integral from 0 to H of C_free dt``.

    C_free is a step function, 0 before its first time.

    A run that ends before the horizon keeps its last coverage: explored cells stay explored.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    """
    if not 0.0 < horizon < math.inf:
        raise ValueError(f"horizon is {horizon} s; want more than 0 and finite")
    at, values = np.asarray(times, np.float64), np.asarray(coverage, np.float64)
    if at.shape != values.shape or at.ndim != 1 or (np.diff(at) < 0.0).any():
        raise ValueError(
            f"times have the shape {at.shape} and coverage {values.shape}; want as many values as times, in "
            "the order of time"
        )
    ends = np.minimum(np.append(at, horizon), horizon)
    return float((np.maximum(np.diff(ends), 0.0) * values).sum() / horizon)


def restricted_time(reached: float | None, horizon: float) -> float:
    """Return ``min(T_p, H)``, H if the threshold was not reached [s].

    Its mean over runs is the restricted mean.
    """
    return horizon if reached is None else min(reached, horizon)


def path_lengths(track: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each robot's path length ``L_i = sum_k |x_k - x_(k-1)|`` [m].

    It is the length of the robot's path through its positions, shape (robots,).

    Parameters
    ----------
    track : (times, robots, 2 or more) float64
        Positions x, y first [m].
    """
    steps = np.diff(np.asarray(track, np.float64)[..., :2], axis=0)
    return np.asarray(np.hypot(steps[..., 0], steps[..., 1]).sum(axis=0))


def balance(shares: ArrayLike) -> float:
    """Return the population standard deviation of the robots' shares ``C_known,i``.

    It is Explore-Bench's "std".

    Parameters
    ----------
    shares : (robots,) float64
        C_known of each robot's own map.
    """
    return float(np.std(np.asarray(shares, np.float64)))


def path_balance(lengths: ArrayLike) -> float:
    """Return the population standard deviation of the path lengths over their mean.

    0 if no robot moved.

    Parameters
    ----------
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    mean = float(np.mean(np.asarray(lengths, np.float64)))
    return float(np.std(np.asarray(lengths, np.float64))) / mean if mean > 0.0 else 0.0


def jain_index(lengths: ArrayLike) -> float:
    """Return Jain's index ``(sum L_i)^2 / (n sum L_i^2)``.

    It is 1 if all robots drive alike, 1/n if one drives alone, and 1 if no robot moved.

    Parameters
    ----------
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    ways = np.asarray(lengths, np.float64)
    squares = float((ways**2).sum())
    return float(ways.sum()) ** 2 / (ways.size * squares) if squares > 0.0 else 1.0


def collisions_per_km(collisions: int, lengths: ArrayLike) -> float | None:
    """Return collisions over the kilometres that the team drove.

    None if no robot moved.

    Parameters
    ----------
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    driven = float(np.sum(np.asarray(lengths, np.float64)))
    return 1e3 * collisions / driven if driven > 0.0 else None


def collisions_per_episode(collisions: Sequence[int]) -> float | None:
    """Return the mean number of collisions of an episode; None without episodes."""
    return float(np.mean(collisions)) if len(collisions) else None


def decision_percentiles(seconds: Sequence[float]) -> dict[str, float | None]:
    """Return the median and 95th percentile of decision times in milliseconds.

    None without decisions.
    """
    if not len(seconds):
        return {"p50": None, "p95": None}
    half, most = np.percentile(np.asarray(seconds, np.float64) * 1e3, [50.0, 95.0])
    return {"p50": round(float(half), 4), "p95": round(float(most), 4)}


def peak_megabytes() -> float | None:
    """Return the most memory that this process has held so far [1e6 bytes].

    None if the system does not provide it.
    """
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # macOS reports bytes, the others kilobytes of 1024.
    return float(peak if sys.platform == "darwin" else peak * 1024) / 1e6
