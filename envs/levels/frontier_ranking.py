"""Which of many frontiers are offered: the cheapest, and the longest of the others."""

from lidarium.mapping.kernels.compilation import Array, kernel


@kernel
def _rank(values: Array, is_wanted: Array, ranked: Array, first: int, last: int) -> int:
    """Write wanted clusters to ``ranked[first:last]``, the highest value first; return where they end.

    The first of equals comes first. What is ranked is wanted no more.
    """
    while first < last:
        best = -1
        for k in range(len(values)):
            if is_wanted[k] and (best < 0 or values[k] > values[best]):
                best = k
        if best < 0:
            break
        is_wanted[best] = False
        ranked[first] = best
        first += 1
    return first


@kernel
def choose_offers(left: Array, sizes: Array, is_wanted: Array, by_size: int, ranked: Array) -> int:
    """Choose which clusters are offered, and return how many.

    They are the cheapest, and of the others the longest; offered in the order of their cost.

    Parameters
    ----------
    left : (clusters,) array
        What is left of the budget at each cluster: more is cheaper.
    sizes : (clusters,) array
        How long each is.
    is_wanted : (clusters,) bool
        Which may be offered; overwritten.
    by_size : int
        How many of the offers are for the longest.
    ranked : (offers,) int64
        Where the numbers of the chosen clusters are written.
    """
    count = int(_rank(left, is_wanted, ranked, 0, len(ranked) - by_size))
    if by_size == 0:
        return count
    count = _rank(sizes, is_wanted, ranked, count, len(ranked))
    is_wanted[:] = False
    for i in range(count):
        is_wanted[ranked[i]] = True
    return int(_rank(left, is_wanted, ranked, 0, count))
