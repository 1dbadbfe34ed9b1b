"""Gaps between walls, and the normal equations of the offsets that close them (kernels)."""

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.wall_alignment import gap_to_wall


@kernel
def find_gaps(
    levels: Array,
    distance: Array,
    side: float,
    places: Array,
    normals: Array,
    reach: float,
    gaps: Array,
    found: Array,
) -> None:
    """Write the gap along the normal from each place to a wall [m], and whether there is one in reach."""
    steps = int(reach / side)
    for i in range(places.shape[0]):
        gap = gap_to_wall(
            levels,
            distance,
            side,
            places[i, 0] / side,
            places[i, 1] / side,
            normals[i, 0],
            normals[i, 1],
            steps,
        )
        found[i] = gap <= steps
        gaps[i] = gap * side if found[i] else 0.0


@kernel
def add_walls(
    nodes: Array,
    weights: Array,
    normals: Array,
    offsets: Array,
    gaps: Array,
    trust: Array,
    band: Array,
    right: Array,
) -> None:
    """Add to normal equations that the offsets along each wall's normal shall close its gap.

    The band holds the lower triangle: entry (i, j) is at (i - j, j).
    """
    for i in range(nodes.shape[0]):
        if trust[i] == 0.0:
            continue
        wanted = gaps[i]
        for j in range(4):
            for axis in range(2):
                wanted += weights[i, j] * normals[i, axis] * offsets[nodes[i, j], axis]
        for j in range(4):
            for axis in range(2):
                row = 2 * nodes[i, j] + axis
                left = trust[i] * weights[i, j] * normals[i, axis]
                right[row] += left * wanted
                for k in range(4):
                    for other in range(2):
                        column = 2 * nodes[i, k] + other
                        if column <= row:
                            band[row - column, column] += left * weights[i, k] * normals[i, other]


@kernel
def add_springs(columns: int, strength: float, band: Array) -> None:
    """Add springs between the neighbouring nodes of a grid of so many columns to a band."""
    count = band.shape[1] // 2
    for node in range(count):
        for step in (1, columns):
            other = node + step
            if other < count and (step > 1 or columns == 1 or other % columns != 0):
                for axis in range(2):
                    band[0, 2 * node + axis] += strength
                    band[0, 2 * other + axis] += strength
                    band[2 * step, 2 * node + axis] -= strength
            if columns == 1:
                break
