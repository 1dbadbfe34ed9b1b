"""Lines fitted to runs of points, with the runs split or merged."""

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel


@kernel
def fit_line(points: Array, first: int, last: int) -> tuple[float, float, float, float, float]:
    """Fit a line to points first .. last by total least squares.

    Returns middle x, y, direction along the points [rad], half length, rms [m].
    """
    count = last - first + 1
    x, y = 0.0, 0.0
    for k in range(first, last + 1):
        x += points[k, 0]
        y += points[k, 1]
    x, y = x / count, y / count
    xx, xy, yy = 0.0, 0.0, 0.0
    for k in range(first, last + 1):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
    theta = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    if (
        np.cos(theta) * (points[last, 0] - points[first, 0])
        + np.sin(theta) * (points[last, 1] - points[first, 1])
        < 0.0
    ):
        theta += np.pi if theta <= 0.0 else -np.pi
    cosine, sine = np.cos(theta), np.sin(theta)
    low, high, across = np.inf, -np.inf, 0.0
    for k in range(first, last + 1):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        along, aside = cosine * dx + sine * dy, cosine * dy - sine * dx
        low, high = min(low, along), max(high, along)
        across += aside * aside
    middle = (low + high) / 2.0
    return x + cosine * middle, y + sine * middle, theta, (high - low) / 2.0, np.sqrt(across / count)


@kernel
def _farthest(points: Array, sigmas: Array, first: int, last: int, limit: float, noise_sigmas: float) -> int:
    """Return the point farthest from the line through the ends.

    If it is too far, else -1.
    """
    x, y = points[first, 0], points[first, 1]
    dx, dy = points[last, 0] - x, points[last, 1] - y
    length = np.sqrt(dx * dx + dy * dy)
    best, farthest = -1, 0.0
    for k in range(first + 1, last):
        px, py = points[k, 0] - x, points[k, 1] - y
        distance = abs(dx * py - dy * px) / length if length > 0.0 else np.sqrt(px * px + py * py)
        excess = distance - max(limit, noise_sigmas * sigmas[k])
        if excess > 0.0 and distance > farthest:
            best, farthest = k, distance
    return best


@kernel
def split_runs(points: Array, sigmas: Array, limit: float, noise_sigmas: float, ends: Array) -> int:
    """Write the ends of the leaves, first and last point included.

    Return the number of leaves.
    """
    stack = np.empty(points.shape[0] + 1, np.int64)
    ends[0], stack[0] = 0, points.shape[0] - 1
    height, count, first = 1, 0, 0
    while height > 0:
        last = stack[height - 1]
        at = _farthest(points, sigmas, first, last, limit, noise_sigmas)
        if at > first:
            stack[height] = at
            height += 1
        else:
            count += 1
            ends[count] = last
            first = last
            height -= 1
    return count


@kernel
def merge_runs(
    points: Array, sigmas: Array, limit: float, noise_sigmas: float, collinear: float, ends: Array, count: int
) -> int:
    """Join neighbouring leaves until no two fit one line; return their number.

    Joined leaves have about one direction, and their points fit one line.
    """
    is_changed = True
    while is_changed and count > 1:
        is_changed = False
        k = 1
        while k < count:
            before, after = fit_line(points, ends[k - 1], ends[k]), fit_line(points, ends[k], ends[k + 1])
            turn = abs(np.arctan2(np.sin(after[2] - before[2]), np.cos(after[2] - before[2])))
            joined = fit_line(points, ends[k - 1], ends[k + 1])
            cosine, sine = np.cos(joined[2]), np.sin(joined[2])
            is_straight = turn <= collinear
            for i in range(ends[k - 1], ends[k + 1] + 1):
                aside = abs(cosine * (points[i, 1] - joined[1]) - sine * (points[i, 0] - joined[0]))
                if aside > max(limit, noise_sigmas * sigmas[i]):
                    is_straight = False
                    break
            if is_straight:
                for i in range(k, count):
                    ends[i] = ends[i + 1]
                count -= 1
                is_changed = True
            else:
                k += 1
    return count
