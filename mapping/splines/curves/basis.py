"""The basis functions of cubic B-splines, and points of curves, in kernels.

A curve has ``n`` control points and ``n + 4`` knots that do not decrease; it is defined from knot 3 to knot
n.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

ORDER = 4
"""Degree 3, and one."""


def basis_matrix(knots: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    """Return the values of all basis functions, shape (parameters, n).

    Each row sums to one within the domain.

    Parameters
    ----------
    knots : (n + 4,) float64
        Not decreasing.
    parameters : (m,) float64
        From knot 3 to knot n; the last span is closed.

    Raises
    ------
    ValueError
        Where a parameter lies outside.
    """
    all_knots, wanted = np.asarray(knots, np.float64), np.atleast_1d(np.asarray(parameters, np.float64))
    count = len(all_knots) - ORDER
    if count < ORDER or (
        wanted.size and not (all_knots[ORDER - 1] <= wanted.min() and wanted.max() <= all_knots[count])
    ):
        raise ValueError(
            f"{len(all_knots)} knots, or parameters outside of the domain; want 8 knots or more and "
            "parameters within"
        )
    matrix = np.zeros((len(wanted), count))
    _fill_basis(all_knots, wanted, matrix)
    return matrix


@kernel
def find_span(knots: Array, count: int, parameter: float) -> int:
    """Return i with knots[i] <= parameter < knots[i + 1].

    The last span that is not empty is closed.
    """
    low, high = ORDER - 1, count
    if parameter >= knots[high]:
        low = high - 1
        while low > ORDER - 1 and knots[low] >= knots[high]:
            low -= 1
        return low
    while high - low > 1:
        middle = (low + high) // 2
        if parameter < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def basis_of_span(knots: Array, span: int, parameter: float, order: int, values: Array) -> None:
    """Write the basis functions of a span, or their derivatives, to ``values`` (4,).

    Functions span - 3 .. span, which do not vanish; derivatives of order 1 or 2.

    Cox and de Boor's recursion; a derivative is a difference of functions of a lower degree.
    """
    values[0] = 1.0
    for degree in range(1, ORDER - order):
        saved = 0.0
        for r in range(degree):
            right, left = knots[span + r + 1], knots[span + r + 1 - degree]
            share = values[r] / (right - left)
            values[r] = saved + (right - parameter) * share
            saved = (parameter - left) * share
        values[degree] = saved
    for degree in range(ORDER - order, ORDER):
        previous = 0.0
        for r in range(degree + 1):
            # Function r of this degree lies between knots span - degree + r and degree further on.
            current = 0.0
            if r < degree:
                width = knots[span + r + 1] - knots[span + r + 1 - degree]
                current = degree * values[r] / width if width > 0.0 else 0.0
            values[r] = previous - current
            previous = current


@kernel
def point_at(
    knots: Array, control_points: Array, parameter: float, order: int, values: Array
) -> tuple[float, float]:
    """Return the curve or a derivative at a parameter, clipped to the domain.

    ``values`` (4,) is scratch.
    """
    count = control_points.shape[0]
    within = min(max(parameter, knots[ORDER - 1]), knots[count])
    span = find_span(knots, count, within)
    basis_of_span(knots, span, within, order, values)
    x, y = 0.0, 0.0
    for r in range(ORDER):
        x += values[r] * control_points[span - ORDER + 1 + r, 0]
        y += values[r] * control_points[span - ORDER + 1 + r, 1]
    return x, y


@kernel
def _fill_basis(knots: Array, parameters: Array, matrix: Array) -> None:
    values = np.empty(ORDER)
    for k in range(parameters.shape[0]):
        span = find_span(knots, matrix.shape[1], parameters[k])
        basis_of_span(knots, span, parameters[k], 0, values)
        for r in range(ORDER):
            matrix[k, span - ORDER + 1 + r] = values[r]
