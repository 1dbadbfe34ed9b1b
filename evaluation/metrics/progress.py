"""How soon, in how many decisions and over what way a team gets where it should.

Runs that do not are censored, not dropped.

Time is simulated time. Coverage over time is a step function: each value holds until the next.

References
----------
T_p: Xu et al., Explore-Bench (ICRA 2022), which takes wall time. D_p as the longest path of the team: MARVEL
(Chiun et al., ICRA 2025) and IR2 (Tan et al., IROS 2024). N_p: decision steps as of IR2. AUC: as of MAexp's
curves (Zhu et al., ICRA 2024). Restricted time: Royston and Parmar, Restricted mean survival time (BMC
Medical Research Methodology, 2013).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def first_reached(coverage: ArrayLike, share: float) -> int | None:
    """Return the index of the first coverage that is at least ``share``.

    It is None where there is none.

    Parameters
    ----------
    coverage : (times,) float64
        Coverage in the order of time.
    share : float
        What is to be reached.
    """
    reached = np.flatnonzero(np.asarray(coverage, np.float64) >= share)
    return int(reached[0]) if reached.size else None


def time_to(times: ArrayLike, coverage: ArrayLike, share: float) -> float | None:
    """Return ``T_p`` = min{t : C_free(t) >= p} [s], None where it is not reached.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    share : float
        p.
    """
    k = first_reached(coverage, share)
    return None if k is None else float(np.asarray(times, np.float64)[k])


def decisions_to(decisions: ArrayLike, coverage: ArrayLike, share: float) -> int | None:
    """Return ``N_p``, the decisions taken until C_free >= p.

    The one in progress is included; None where p is not reached.

    Parameters
    ----------
    decisions : (times,) int
        Decisions taken until each time.
    coverage : (times,) float64
        Coverage at these times.
    share : float
        p.
    """
    k = first_reached(coverage, share)
    return None if k is None else int(np.asarray(decisions)[k])


def distance_to(lengths: NDArray[np.float64], coverage: ArrayLike, share: float) -> float | None:
    """Return ``D_p`` = max_i L_i(T_p), the longest path of the team [m].

    It is taken when C_free >= p first; None where p is not reached.

    Parameters
    ----------
    lengths : (times, robots) float64
        Length of each robot's path until each time [m].
    coverage : (times,) float64
        Coverage at these times.
    share : float
        p.
    """
    k = first_reached(coverage, share)
    return None if k is None else float(lengths[k].max())


def distance_sum_to(lengths: NDArray[np.float64], coverage: ArrayLike, share: float) -> float | None:
    """Return ``D_sum,p`` = sum_i L_i(T_p), the path length of the whole team [m].

    It is taken when C_free >= p first; as `distance_to`.
    """
    k = first_reached(coverage, share)
    return None if k is None else float(lengths[k].sum())


def is_success(times: ArrayLike, coverage: ArrayLike, share: float, horizon: float | None) -> bool:
    """Return whether ``T_p <= H``.

    The coverage that stops a run was then reached within the horizon.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    share : float
        p.
    horizon : float or None
        H [s]; None for no horizon.
    """
    reached = time_to(times, coverage, share)
    # Times are whole numbers of steps: a horizon that is not must not lose its last step to rounding.
    return reached is not None and (horizon is None or reached <= horizon + 1e-9)


def area_under_curve(times: ArrayLike, coverage: ArrayLike, horizon: float) -> float:
    """Return ``AUC = (1 / H) integral from 0 to H of C_free dt``.

    C_free is a step function, 0 before its first time.

    A run that ends before the horizon keeps its last coverage: what is explored stays explored.

    Parameters
    ----------
    times, coverage : (times,) float64
        Coverage over time [s].
    horizon : float
        H, above 0 [s].

    Raises
    ------
    ValueError
        Where the horizon is not positive and finite, or times do not increase.
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
    """Return ``min(T_p, H)``, H where the threshold was not reached [s].

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
