"""How evenly robots share the work.

References
----------
Balance: Xu et al., Explore-Bench (ICRA 2022), "std". Jain index: Jain, Chiu and Hawe, A quantitative measure
of fairness (1984).
"""

import numpy as np
from numpy.typing import ArrayLike


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

    0 where nobody moved.

    Parameters
    ----------
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    mean = float(np.mean(np.asarray(lengths, np.float64)))
    return float(np.std(np.asarray(lengths, np.float64))) / mean if mean > 0.0 else 0.0


def jain_index(lengths: ArrayLike) -> float:
    """Return Jain's index ``(sum L_i)^2 / (n sum L_i^2)``.

    It is 1 where all robots drive alike, 1/n where one drives alone, and 1 where nobody moved.

    Parameters
    ----------
    lengths : (robots,) float64
        Length of each robot's path [m].
    """
    ways = np.asarray(lengths, np.float64)
    squares = float((ways**2).sum())
    return float(ways.sum()) ** 2 / (ways.size * squares) if squares > 0.0 else 1.0
