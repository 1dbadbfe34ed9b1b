"""The vector operations in plain Python, on blocks at addresses.

Each takes what the operation that LLVM compiles takes; ``machine_code`` puts it in its place where Python
runs kernels.
"""

from typing import Any, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.in_python import plain
from lidarium.mapping.kernels.in_python.interpreted import array_at

BLOCK = 64
HALF_BLOCK = 32
LANES = 8
PIXEL_LANES = 16
GROUP = 16
RAYS = 32


def _bytes(address: int, count: int = BLOCK) -> NDArray[Any]:
    return array_at(address, (count,), np.int8)


def _shorts(address: int, count: int = BLOCK, kind: type = np.uint16) -> NDArray[Any]:
    return array_at(address, (count,), kind)


def _word(cells: Any) -> np.uint64:  # noqa: ANN401
    return np.uint64(plain.bits_of(cells))


def first_bit(word: np.uint64) -> int:
    """Return which bit of a word is the first that is set."""
    return plain.first_bit(int(word))


def last_bit(word: np.uint64) -> int:
    """Return which bit of a word is the last that is set."""
    return int(word).bit_length() - 1


def running_xor(word: np.uint64) -> np.uint64:
    """Return the running exclusive-or of a word's bits."""
    return np.uint64(plain.running_xor(int(word)))


def update_block(
    address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int
) -> np.uint64:
    """Lower the seen cells of a block and raise the hit ones."""
    block = _bytes(address)
    block[:], changed = plain.update_block(block, int(seen), int(hits), (hit, miss), (minimum, maximum))
    return np.uint64(changed)


def fetch_block(_address: int) -> None:
    """Do nothing: memory is loaded when it is read."""


def sum_blocks(first: int, second: int, result: int) -> None:
    """Write the sum of two blocks into a third."""
    _bytes(result)[:] = plain.sum_blocks(_bytes(first), _bytes(second))


def write_greatest(rows: int, stride: int, count: int, least: int, halvings: int, result: int) -> None:
    """Write the greatest of groups of cells, and of ``least``."""
    blocks = [_bytes(rows + k * stride) for k in range(count)] or [np.full(BLOCK, least, np.int8)]
    greatest = plain.greatest_of_groups(np.array(blocks), least, halvings)
    _bytes(result, greatest.size)[:] = greatest


def write_levels(log_odds: int, levels: int, cells: int = HALF_BLOCK) -> None:
    """Write cells as levels."""
    array_at(levels, (cells,), np.uint8)[:] = plain.levels_of(_bytes(log_odds, cells))


def write_block_of_levels(log_odds: int, levels: int) -> None:
    """Write a block of cells as levels."""
    write_levels(log_odds, levels, BLOCK)


def sign_bits(address: int) -> tuple[np.uint64, np.uint64]:
    """Return which int16 of a block are below 0, and which above."""
    sums = _shorts(address, kind=np.int16)
    return _word(sums < 0), _word(sums > 0)


def negative_cells(address: int) -> np.uint64:
    """Return which cells of a block are less than 0."""
    return _word(_bytes(address) < 0)


def positive_cells(address: int) -> np.uint64:
    """Return which cells of a block are more than 0."""
    return _word(_bytes(address) > 0)


def cells_that_differ(log_odds: int, numbers: int, number: int) -> np.uint64:
    """Return in which cells only one holds: positive log-odds, or the number."""
    return _word((_bytes(log_odds) > 0) != (_shorts(numbers) == number))


def count_rows(
    log_odds: int, stride: int, rows: int, steps: int, largest: int, fewest: int, width: int
) -> None:
    """Count the rows since the last occupied cell of each column."""
    if rows <= 0:
        return
    beliefs = np.array([_bytes(log_odds + k * stride) for k in range(rows)])
    counted = plain.count_rows(beliefs, _shorts(steps).astype(int), largest)
    for k, row in enumerate(counted):
        target = _shorts(fewest + k * width)
        target[:] = np.minimum(target, row)
    _shorts(steps)[:] = counted[-1]


def write_squares(steps: int, far: int, cap: int, result: int) -> int:
    """Write squared distances after steps; return the fewest steps."""
    counted = _shorts(steps)
    fewest = int(counted.min())
    _shorts(result)[:] = plain.squares_of(counted, far, cap)
    return fewest


def write_least_sums(numbers: int, costs: int, low: int, high: int, cap: int, result: int) -> None:
    """Write ``cap`` less the least sums of numbers and costs."""
    count = max(high - low, 0)
    given, added = _shorts(numbers + 2 * low, count + BLOCK - 1), _shorts(costs + 2 * low, count)
    _shorts(result)[:] = plain.least_sums(given, added, cap) if count else 0


def raise_block(block: int, other: int) -> None:
    """Raise the numbers of a block to those of another."""
    _shorts(block)[:] = np.maximum(_shorts(block), _shorts(other))


def same_cells(block: int, other: int) -> np.uint64:
    """Return which numbers of two blocks are the same, and not 0."""
    return np.uint64(plain.same_cells(_shorts(block), _shorts(other)))


def lower_lanes(
    inverses: int,
    directions: int,
    ranges: int,
    distance: float,
    run: float,
    low: float,
    high: float,
) -> None:
    """Lower the ranges of the beams in the lanes that meet a face."""
    lanes, along, across = (
        array_at(address, (LANES,), np.float64) for address in (ranges, inverses, directions)
    )
    lanes[:] = plain.lower_ranges(lanes, along, across, distance, (run, low, high))


def travel_rays(
    squares: int,
    shape: tuple[int, int],
    origin: tuple[float, float, float],
    together: int,
    directions: int,
    stride: int,
    ranges: int,
) -> None:
    """Write where rays that are free up to a distance enter a solid cell."""
    table, found = _squares(squares, shape), array_at(ranges, (RAYS,), np.float64)
    rows = np.array([array_at(directions + k * stride, (RAYS,), np.float64) for k in range(4)])
    starts = array_at(together, (RAYS // GROUP,), np.float64)
    for ray in range(RAYS):
        found[ray] = plain.end_of_ray(table, origin, rows[:, ray].tolist(), float(starts[ray // GROUP]))


def travel_bundles(
    squares: int,
    shape: tuple[int, int],
    origin: tuple[float, float, float],
    inside: float,
    bundles: int,
    stride: int,
) -> None:
    """Find how far bundles of rays run through squares that hold them all."""
    table = _squares(squares, shape)
    rows = [array_at(bundles + k * stride, (RAYS,), np.float64) for k in range(7)]
    for bundle in range(RAYS):
        outer = [float(row[bundle]) for row in rows[:6]]
        rows[6][bundle] = plain.end_of_bundle(table, origin, outer, inside)


def _squares(address: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    plane, columns = shape
    return array_at(address, (4, plane // columns, columns), np.uint8)


def raise_lanes(address: int, start: float, slope: float, first: int, last: int) -> None:
    """Raise the pixels from lane ``first`` to lane ``last`` to ``start + slope * lane``."""
    pixels = array_at(address, (PIXEL_LANES,), np.float32)
    pixels[:] = plain.raised_pixels(pixels, start, slope, first, last)


def nearest_in_tile(points: int, codes: int, numbers: int, count: int, squares: int, labels: int) -> None:
    """Lower squared distances of a tile's points by codes, and note the nearest."""
    nearest, chosen = array_at(squares, (BLOCK,), np.float32), array_at(labels, (BLOCK,), np.int32)
    nearest[:], chosen[:] = plain.nearest_codes(
        array_at(points, (3, BLOCK), np.float32),
        array_at(codes, (count, 3), np.float32),
        array_at(numbers, (count,), np.int32),
        (nearest, chosen),
    )


def relax_forwards(costs: int, straight: int, diagonal: int, kinds: int, at: int, beside: int) -> int:
    """Lower the costs of 16 cells by those of the row beside and, in the order of columns, of their own."""
    return _relax((costs, straight, diagonal, kinds), at, beside, 1)


def relax_backwards(costs: int, straight: int, diagonal: int, kinds: int, at: int, beside: int) -> int:
    """Lower the costs of 16 cells by those of the row beside and, against the columns, of their own."""
    return _relax((costs, straight, diagonal, kinds), at, beside, -1)


def _relax(grids: tuple[int, int, int, int], at: int, beside: int, step: int) -> int:
    """Lower the costs of 16 cells; return the bits of those that have changed."""
    numbers, width = max(at, beside) + GROUP + 1, np.int32
    costs, straight, diagonal = (array_at(grid, (numbers,), width) for grid in grids[:3])
    kinds, changed = array_at(grids[3], (numbers,), np.uint8), 0
    for k in range(GROUP)[::step]:
        cell, before = at + k, costs[at + k]
        if not kinds[cell] & 2:
            continue
        ways = [before, 2**29, costs[beside + k] + straight[beside + k] + straight[cell]]
        ways.append(costs[cell - step] + straight[cell - step] + straight[cell])
        for side in (-1, 1):
            corner, between = beside + k + side, (kinds[beside + k], kinds[cell + side])
            is_roomy = kinds[cell] & kinds[corner] & 4 and (between[0] | between[1]) & 1
            if is_roomy or between[0] & between[1] & 2:
                ways.append(costs[corner] + diagonal[corner] + diagonal[cell])
        costs[cell] = min(ways)
        changed |= int(costs[cell] != before) << k
    return changed


def look_up_costs(log_odds: int, closeness: int, body: int, kinds: int, straight: int, diagonal: int) -> None:
    """Write the kinds of 16 cells, and what steps cost there."""
    table, length, plain_up_to, tight, roomy = array_at(body, (5,), np.int64).tolist()
    near = np.asarray(_shorts(closeness, GROUP))
    free = _bytes(log_odds, GROUP) < 0
    fits = free & (near <= tight)
    array_at(kinds, (GROUP,), np.uint8)[:] = free + 2 * fits + 4 * (free & (near <= roomy))
    places = np.where(near > plain_up_to, near, 0)
    if not fits.any():
        return
    for address, costs in zip((straight, diagonal), array_at(table, (2, length), np.int32), strict=True):
        array_at(address, (GROUP,), np.int32)[:] = np.where(fits, np.asarray(costs)[places], 0)


def cheaper_cells(costs: int, limit: int) -> int:
    """Return which of 16 costs are below a limit."""
    return plain.bits_of(array_at(costs, (GROUP,), np.int32) < limit)


def add_one(address: int) -> int:
    """Count on at an address; return the number before."""
    counter = array_at(address, (1,), np.int64)
    counter[0] += 1
    return int(counter[0]) - 1


def vector_view(address: int, count: int, kind: Any) -> NDArray[Any]:  # noqa: ANN401
    """View a vector at an address."""
    return array_at(address, (count,), kind)


def grid_view(address: int, rows: int, columns: int, kind: Any) -> NDArray[Any]:  # noqa: ANN401
    """View a grid at an address."""
    return array_at(address, (rows, columns), kind)


def named_views(table: NDArray[np.int64], named: Any) -> Any:  # noqa: ANN401
    """View all arrays of a table as the fields of a class of arrays."""
    hints = get_type_hints(named, include_extras=True)
    views = []
    for name, (address, *shape) in zip(named._fields, table.tolist(), strict=False):
        _, dtype, dimensions = get_args(hints[name])
        views.append(array_at(address, tuple(shape[:dimensions]), dtype))
    return named(*views)
