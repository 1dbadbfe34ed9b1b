"""Vector operations of ``mapping/kernels/simd`` compared with the same operations as plain numba loops.

Usage: python benchmarks/speed/cases/simd.py [NAME ...]

It prints a table in Markdown: nanoseconds per call, and the time of plain numba in multiples of that of the
hand-written text: the median of rounds in which both run in turns. The results are in
``docs/how_to/change_a_kernel.md``.
"""

import functools
import math
import statistics
import sys
from collections import namedtuple
from collections.abc import Callable
from typing import Any

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from lidarium.benchmarks.speed.harness.timing import Effort, compared, interleaved, repeated
from lidarium.envs.simulation.kernels.ray_casting import cast_in_lanes, cast_one_by_one
from lidarium.envs.simulation.kernels.ray_tables import RayTables
from lidarium.mapping.grids.map_crops import turn_by_cells, turn_in_registers
from lidarium.mapping.grids.scan_geometry import Beams, ScanGeometry, beam_directions
from lidarium.mapping.kernels.compilation import Array
from lidarium.mapping.kernels.simd import cells, clearance, codes, convolution, costs, crops, faces, words
from lidarium.mapping.kernels.views import vector_at

BLOCKS = 2048
"""Blocks of 64 cells that a repeat goes through: with their results they fit into the second cache."""

BLOCK = 64
_compile: Any = numba.njit(nogil=True, error_model="numpy")
_inlined: Any = numba.njit(nogil=True, error_model="numpy", forceinline=True)


def _arrays() -> dict[str, NDArray[Any]]:
    """Return the arrays that the operations read and write, with one row for each block."""
    draw = np.random.default_rng(0)
    kinds = draw.choice(np.array([0, 1, 3, 7, 7, 7], np.uint8), (3 * BLOCKS, 16))
    grids = np.stack([draw.integers(2378, 9000, kinds.shape) for _ in range(3)]).astype(np.int32)
    grids[0] *= 5
    table = np.sort(draw.integers(2378, 9000, 4096).astype(np.int32))
    own, others = (draw.integers(-20, 30, (BLOCKS, BLOCK)).astype(np.int8) for _ in range(2))
    return {
        "cells": own,
        "others": others,
        "grid_addresses": np.array([own.ctypes.data, others.ctypes.data]),
        "results": np.zeros((BLOCKS, BLOCK), np.int8),
        "numbers": draw.integers(0, 90, (BLOCKS, BLOCK)).astype(np.uint16),
        "costs": draw.integers(0, 900, (BLOCKS, BLOCK)).astype(np.uint16),
        "sums": np.zeros((BLOCKS, BLOCK), np.uint16),
        "words": draw.integers(1, 2**63, BLOCKS, dtype=np.uint64),
        "reals": draw.uniform(-9.0, 9.0, (3, BLOCKS, 8)),
        "pixels": draw.uniform(0.0, 1.0, (BLOCKS, BLOCK)).astype(np.float32),
        "labels": np.zeros((BLOCKS, BLOCK), np.int32),
        "taps": np.arange(9) // 3 * 328 + np.arange(9) % 3 * 4,
        "totals": np.zeros((BLOCKS, BLOCK), np.float32),
        "grids": grids,
        "kinds": kinds,
        "table": table,
        "body": np.array([table.ctypes.data, 2048, 20, 70, 40]),
    }


# -- The operations as plain loops -------------------------------------------------------------------------


@_inlined
def _first_bit(word: np.uint64) -> Any:  # noqa: ANN401
    count = 0
    while not word & np.uint64(1):
        word >>= np.uint64(1)
        count += 1
    return count


@_inlined
def _running_xor(word: np.uint64) -> Any:  # noqa: ANN401
    for k in (1, 2, 4, 8, 16, 32):
        word ^= word << np.uint64(k)
    return word


@_inlined
def _update_block(
    address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int
) -> Any:  # noqa: ANN401
    cells, changed = vector_at(address, BLOCK, np.int8), np.uint64(0)
    for k in range(BLOCK):
        old = int(cells[k])
        new = old
        if hits >> np.uint64(k) & np.uint64(1):
            new = min(min(old + hit, 127), maximum)
        elif seen >> np.uint64(k) & np.uint64(1):
            new = max(max(old - miss, -128), minimum)
        cells[k] = new
        changed |= np.uint64(((old > 0) != (new > 0)) | ((old < 0) != (new < 0))) << np.uint64(k)
    return changed


@_inlined
def _sum_blocks(grids: int, stride: int, count: int, place: int, result: int) -> None:
    total = vector_at(result, BLOCK, np.int8)
    for k in range(BLOCK):
        value = 0
        for grid in range(count):
            value += int(vector_at(vector_at(grids + grid * stride, 1, np.int64)[0] + place, BLOCK, np.int8)[k])
        total[k] = max(min(value, 127), -127)


@_inlined
def _max_of_groups(rows: int, stride: int, count: int, minimum: int, halvings: int, result: int) -> None:
    greatest = vector_at(result, BLOCK, np.int8)
    for k in range(BLOCK):
        greatest[k] = minimum
    for row in range(count):
        cells = vector_at(rows + row * stride, BLOCK, np.int8)
        for k in range(BLOCK):
            greatest[k] = max(greatest[k], cells[k])
    for halving in range(halvings):
        for k in range(BLOCK >> (halving + 1)):
            greatest[k] = max(greatest[2 * k], greatest[2 * k + 1])


@_inlined
def _half_block_of_levels(log_odds: int, result: int) -> None:
    cells, written = vector_at(log_odds, 32, np.int8), vector_at(result, 32, np.uint8)
    for k in range(32):
        written[k] = 0 if cells[k] > 0 else 255 if cells[k] < 0 else 127


@_inlined
def _sign_bits(address: int) -> Any:  # noqa: ANN401
    cells, below, above = vector_at(address, BLOCK, np.int16), np.uint64(0), np.uint64(0)
    for k in range(BLOCK):
        below |= np.uint64(cells[k] < 0) << np.uint64(k)
        above |= np.uint64(cells[k] > 0) << np.uint64(k)
    return below, above


@_inlined
def _negative_cells(address: int) -> Any:  # noqa: ANN401
    cells, word = vector_at(address, BLOCK, np.int8), np.uint64(0)
    for k in range(BLOCK):
        word |= np.uint64(cells[k] < 0) << np.uint64(k)
    return word


@_inlined
def _positive_cells(address: int) -> Any:  # noqa: ANN401
    cells, word = vector_at(address, BLOCK, np.int8), np.uint64(0)
    for k in range(BLOCK):
        word |= np.uint64(cells[k] > 0) << np.uint64(k)
    return word


@_inlined
def _cells_that_differ(log_odds: int, numbers: int, number: int) -> Any:  # noqa: ANN401
    cells, others, word = (vector_at(log_odds, BLOCK, np.int8), vector_at(numbers, BLOCK, np.uint16), np.uint64(0))
    for k in range(BLOCK):
        word |= np.uint64((cells[k] > 0) != (others[k] == number)) << np.uint64(k)
    return word


@_inlined
def _count_rows(log_odds: int, stride: int, rows: int, steps: int, maximum: int, minima: int, width: int) -> None:
    counted = vector_at(steps, BLOCK, np.uint16)
    for row in range(rows):
        cells = vector_at(log_odds + row * stride, BLOCK, np.int8)
        lowest = vector_at(minima + row * width, BLOCK, np.uint16)
        for k in range(BLOCK):
            counted[k] = np.uint16(0) if cells[k] > 0 else np.uint16(min(int(counted[k]) + 1, maximum))
            lowest[k] = min(lowest[k], counted[k])


@_inlined
def _write_squares(steps: int, far: int, cap: int, result: int) -> Any:  # noqa: ANN401
    counted, squares, lowest = vector_at(steps, BLOCK, np.uint16), vector_at(result, BLOCK, np.uint16), 65535
    for k in range(BLOCK):
        half_cells = np.int32(max(2 * int(counted[k]) - 1, 0))
        squares[k] = min(int(half_cells * half_cells), cap) if counted[k] < far else cap
        lowest = min(lowest, int(counted[k]))
    return lowest


@_inlined
def _write_min_sums(numbers: int, costs: int, low: int, high: int, cap: int, result: int) -> None:
    given, written = vector_at(numbers, BLOCK + high, np.uint16), vector_at(result, BLOCK, np.uint16)
    added = vector_at(costs, high, np.uint16)
    for j in range(BLOCK):
        written[j] = cap
    for k in range(low, high):
        for j in range(BLOCK):
            written[j] = min(written[j], np.uint16(given[j + k] + added[k]))
    for j in range(BLOCK):
        written[j] = np.uint16(cap) - written[j]


@_inlined
def _same_cells(block: int, other: int) -> Any:  # noqa: ANN401
    first, second, word = vector_at(block, BLOCK, np.uint16), vector_at(other, BLOCK, np.uint16), np.uint64(0)
    for k in range(BLOCK):
        word |= np.uint64((first[k] == second[k]) & (second[k] != 0)) << np.uint64(k)
    return word


@_inlined
def _lower_ranges(
    inverses: int, directions: int, ranges: int, distance: float, run: float, low: float, high: float
) -> None:
    inverse, direction = vector_at(inverses, 8, np.float64), vector_at(directions, 8, np.float64)
    nearest = vector_at(ranges, 8, np.float64)
    for k in range(8):
        candidate = distance * inverse[k]
        along = run + candidate * direction[k]
        if (low <= along) & (along <= high) & (candidate > 0.0) & (candidate < nearest[k]):
            nearest[k] = candidate


@_inlined
def _raise_pixels(address: int, start: np.float32, slope: np.float32, first: int, last: int) -> None:
    pixels = vector_at(address, 16, np.float32)
    for k in range(16):
        new = start + slope * np.float32(k)
        if (first <= k) & (k <= last) & (new > pixels[k]):
            pixels[k] = new


@_inlined
def _bound_columns(edges: int, row: float, columns: float, begins: int, ends: int) -> None:
    bounds = vector_at(edges, 16, np.float64)
    firsts, lasts = vector_at(begins, 8, np.int32), vector_at(ends, 8, np.int32)
    for k in range(8):
        low, high = -0.5, columns - 0.5
        for edge in range(0, 8, 2):
            low = max(low, bounds[edge] + bounds[edge + 1] * (row + k))
            high = min(high, bounds[edge + 8] + bounds[edge + 9] * (row + k))
        firsts[k] = np.int32(np.ceil(min(low, columns) - 1e-7))
        lasts[k] = np.int32(np.floor(max(high, -1.0) + 1e-7))


@_inlined
def _nearest_in_tile(points: int, codes: int, numbers: int, count: int, squares: int, labels: int) -> None:
    point, nearest = vector_at(points, 3 * BLOCK, np.float32), vector_at(squares, BLOCK, np.float32)
    code, number, chosen = (
        vector_at(codes, 3 * count, np.float32),
        vector_at(numbers, count, np.int32),
        vector_at(labels, BLOCK, np.int32),
    )
    for c in range(count):
        for k in range(BLOCK):
            x, y = point[k] - code[3 * c], point[BLOCK + k] - code[3 * c + 1]
            z = point[2 * BLOCK + k] - code[3 * c + 2]
            square = x * x + y * y + z * z
            is_nearer = square < nearest[k]
            nearest[k] = square if is_nearer else nearest[k]
            chosen[k] = number[c] if is_nearer else chosen[k]


@_inlined
def _add_taps(
    sums: int,
    row: int,
    source: int,
    channel: int,
    channels: int,
    taps: int,
    count: int,
    weights: int,
    bias: int,
    least: float,
    last: int,
) -> None:
    lanes, outputs, shifts = convolution.LANES, convolution.OUTPUTS, vector_at(taps, count, np.int64)
    factors, begins = (
        vector_at(weights, channels * count * outputs, np.float32),
        vector_at(bias, outputs, np.float32),
    )
    for output in range(outputs):
        found = vector_at(sums + output * row, lanes, np.float32)
        for k in range(lanes):
            found[k] += begins[output]
        for k in range(channels):
            for tap in range(count):
                numbers = vector_at(source + k * channel + shifts[tap], lanes, np.float32)
                factor = factors[(k * count + tap) * outputs + output]
                for lane in range(lanes):
                    found[lane] += factor * numbers[lane]
        for k in range(lanes):
            found[k] = max(found[k], least)
        if last:
            added = vector_at(last + output * channel, lanes, np.float32)
            for k in range(lanes):
                found[k] += added[k]


@_inlined
def _relax_forwards(costs_at: int, straight_at: int, diagonal_at: int, kinds_at: int, at: int, beside: int) -> Any:  # noqa: ANN401
    size, changed = max(at, beside) + 17, 0
    costs, straight = vector_at(costs_at, size, np.int32), vector_at(straight_at, size, np.int32)
    diagonal, kinds = vector_at(diagonal_at, size, np.int32), vector_at(kinds_at, size, np.uint8)
    for k in range(16):
        cell, near = at + k, beside + k
        if not kinds[cell] & 2:
            continue
        new = min(costs[cell], 2**29, costs[near] + straight[near] + straight[cell])
        new = min(new, costs[cell - 1] + straight[cell - 1] + straight[cell])
        for side in (-1, 1):
            across, along = kinds[near], kinds[cell + side]
            is_roomy = (kinds[cell] & kinds[near + side] & 4) and (across | along) & 1
            if is_roomy or across & along & 2:
                new = min(new, costs[near + side] + diagonal[near + side] + diagonal[cell])
        changed |= int(new != costs[cell]) << k
        costs[cell] = new
    return changed


@_inlined
def _look_up_costs(log_odds: int, closeness: int, body: int, kinds: int, straight: int, diagonal: int) -> None:
    settings, cells = vector_at(body, 5, np.int64), vector_at(log_odds, 16, np.int8)
    near, found = vector_at(closeness, 16, np.uint16), vector_at(kinds, 16, np.uint8)
    length, same, tight, roomy = settings[1], settings[2], settings[3], settings[4]
    table = vector_at(settings[0], 2 * length, np.int32)
    first, second = vector_at(straight, 16, np.int32), vector_at(diagonal, 16, np.int32)
    for k in range(16):
        free = cells[k] < 0
        fits = free & (near[k] <= tight)
        found[k] = free + 2 * fits + 4 * (free & (near[k] <= roomy))
        place = near[k] if near[k] > same else 0
        first[k] = table[place] if fits else 0
        second[k] = table[length + place] if fits else 0


@_inlined
def _cheaper_cells(costs: int, limit: int) -> Any:  # noqa: ANN401
    numbers, bits = vector_at(costs, 16, np.int32), 0
    for k in range(16):
        bits |= int(numbers[k] < limit) << k
    return bits


@_inlined
def _difference(words: tuple[np.uint64, np.uint64]) -> Any:  # noqa: ANN401
    return int(words[0] ^ words[1])


# -- How each is called for block k ------------------------------------------------------------------------


def _chained(operation: Any) -> Any:  # noqa: ANN401
    """Return a function whose calls wait for each other, as in the filling of polygons."""

    def call(data: Any, k: int) -> int:  # noqa: ANN401
        data.words[-1] = operation(data.words[k] ^ (data.words[-1] >> np.uint64(63)))
        return int(data.words[-1])

    return call


def _calls() -> dict[str, tuple[Any, Any, Callable[[Any], Any]]]:
    """Return for each operation: vector text, plain loop, and the function that calls either for a block."""
    f4 = np.float32
    # fmt: off
    return {
        "first_bit": (words.first_bit, _first_bit, lambda op: lambda d, k: op(d.words[k])),
        "running_xor": (words.running_xor, _running_xor, _chained),
        "update_block": (cells.update_block, _update_block,
            lambda op: (lambda d, k: int(op(d.cells + 64 * k, d.words[k], d.words[k] >> np.uint64(3), 9, 4,
                -20, 30)))),
        "sum_blocks": (cells.sum_blocks, _sum_blocks,
            lambda op: (lambda d, k: op(d.grid_addresses, 8, 2, 64 * k, d.results + 64 * k))),
        "max_of_groups": (cells.max_of_groups, _max_of_groups,
            lambda op: (lambda d, k: op(d.cells + 64 * (k & ~3), 64, 4, -128, 2, d.results + 64 * k))),
        "half_block_of_levels": (cells.half_block_of_levels, _half_block_of_levels,
            lambda op: lambda d, k: op(d.cells + 64 * k, d.results + 64 * k)),
        "sign_bits": (cells.sign_bits, _sign_bits,
            lambda op: lambda d, k: _difference(op(d.numbers + 128 * k))),
        "negative_cells": (cells.negative_cells, _negative_cells,
            lambda op: lambda d, k: int(op(d.cells + 64 * k))),
        "positive_cells": (cells.positive_cells, _positive_cells,
            lambda op: lambda d, k: int(op(d.cells + 64 * k))),
        "cells_that_differ": (clearance.cells_that_differ, _cells_that_differ,
            lambda op: lambda d, k: int(op(d.cells + 64 * k, d.numbers + 128 * k, 3))),
        "count_rows": (clearance.count_rows, _count_rows,
            lambda op: (lambda d, k: op(d.cells + 64 * (k & ~7), 64, 8, d.sums + 128 * k, 90,
                d.numbers + 128 * (k & ~7), 128))),
        "write_squares": (clearance.write_squares, _write_squares,
            lambda op: (lambda d, k: op(d.numbers + 128 * k, 80, 25_000, d.sums + 128 * k))),
        "write_min_sums": (clearance.write_min_sums, _write_min_sums,
            lambda op: (lambda d, k: op(d.costs + 128 * (k & ~1), d.costs, 0, 16, 1500, d.sums + 128 * k))),
        "same_cells": (clearance.same_cells, _same_cells,
            lambda op: lambda d, k: int(op(d.sums + 128 * k, d.numbers + 128 * k))),
        "lower_ranges": (faces.lower_ranges, _lower_ranges,
            lambda op: (lambda d, k: op(d.reals + 64 * k, d.reals + 64 * (k + BLOCKS),
                d.reals + 64 * (k + 2 * BLOCKS), 3.0, 0.5, -5.0, 5.0))),
        "raise_pixels": (faces.raise_pixels, _raise_pixels,
            lambda op: lambda d, k: op(d.pixels + 256 * k, f4(0.3), f4(0.01), k & 7, 12)),
        "bound_columns": (faces.bound_columns, _bound_columns,
            lambda op: (lambda d, k: op(d.reals + 64 * (k & ~1), 2.0, 64.0, d.labels + 64 * k,
                d.labels + 64 * k + 32))),
        "nearest_in_tile": (codes.nearest_in_tile, _nearest_in_tile,
            lambda op: (lambda d, k: op(d.pixels + 256 * (k & 1023), d.pixels, d.grids, 20,
                d.pixels + 256 * (k & 255) + 256 * 1100, d.labels + 256 * k))),
        "add_taps": (convolution.add_taps, _add_taps,
            lambda op: (lambda d, k: op(d.totals + 256 * (k & 63), 16384, d.pixels + 128 * (k & 255), 8192, 24, d.taps,
                9, d.pixels, d.pixels, 0.0, 0))),
        "relax_forwards": (costs.relax_forwards, _relax_forwards,
            lambda op: (lambda d, k: op(d.grids, d.grids + 192 * BLOCKS, d.grids + 384 * BLOCKS, d.kinds,
                16 * (k + 1), 16 * (k + 1 + BLOCKS)))),
        "look_up_costs": (costs.look_up_costs, _look_up_costs,
            lambda op: (lambda d, k: op(d.cells + 64 * k, d.numbers + 128 * k, d.body, d.kinds + 16 * k,
                d.grids + 64 * k, d.grids + 64 * (k + BLOCKS)))),
        "cheaper_cells": (costs.cheaper_cells, _cheaper_cells,
            lambda op: lambda d, k: op(d.grids + 64 * k, 25_000)),
    }
    # fmt: on


def _runs(
    operations: tuple[Any, Any],
    adapt: Callable[[Any], Any],
    data: Any,  # noqa: ANN401
) -> list[Callable[[], object]]:
    """Return functions that run either form on all blocks and keep its results, if it has any."""
    returned = np.zeros(BLOCKS, np.int64)

    def run(call: Any) -> Callable[[], object]:  # noqa: ANN401
        def write_only(data: Any, _returned: Array) -> None:  # noqa: ANN401
            for k in range(BLOCKS):
                call(data, k)

        def keep_results(data: Any, returned: Array) -> None:  # noqa: ANN401
            for k in range(BLOCKS):
                returned[k] = call(data, k)

        returns = operations[0].__annotations__["return"] is not None
        compiled = _compile(keep_results if returns else write_only)
        return lambda: compiled(data, returned)

    return [run(_inlined(adapt(operation))) for operation in operations]


def _scans() -> list[Callable[[], object]]:
    """Return functions that cast a scan in lanes and one ray after the other, on a floor with pillars."""
    solid = np.zeros((1200, 1200), np.uint8)
    solid[::75, ::60] = 1
    solid[[0, -1]], solid[:, [0, -1]] = 1, 1
    tables, geometry = RayTables(solid), ScanGeometry(beams=720, field_of_view=2.0 * math.pi)
    directions = np.empty((4, 720))
    beam_directions(0.3, geometry.unit_vectors, directions)
    first, increment = geometry.angle_first, geometry.angle_increment
    beams, ranges = Beams(613.4, 588.7, 0.3, first, increment, directions, 400.0), np.empty(720)
    squares = tables.squares.ravel()
    return [
        functools.partial(cast, squares, tables.rows, tables.columns, beams, ranges)
        for cast in (cast_in_lanes, cast_one_by_one)
    ]


def _crops(kept: list[Array]) -> list[Callable[[], object]]:
    """Return functions that fill turned crops in registers and cell by cell."""
    log_odds = np.random.default_rng(0).integers(-20, 30, (512, 512)).astype(np.int8)
    pools = np.array([[log_odds.ctypes.data, 512, 512]])
    scales, result = np.ones(1, np.int64), np.empty((1, 64, 64), np.uint8)
    kept.append(log_odds)  # it is read at its address
    return [
        functools.partial(turn, pools, 250.3, 260.8, 0.7, scales, result) for turn in (turn_in_registers, turn_by_cells)
    ]


def main() -> None:
    """Measure all operations, or those that are named."""
    kept: list[Array] = []
    names, effort, arrays = sys.argv[1:], Effort(rounds=15, block_s=0.05), _arrays()
    addresses = {name: array if name == "words" else array.ctypes.data for name, array in arrays.items()}
    data = namedtuple("Data", addresses)(**addresses)
    pairs = {name: (_runs(forms[:2], forms[2], data), BLOCKS) for name, forms in _calls().items()}
    pairs["travel_rays, travel_bundles (a scan)"] = _scans(), 1
    if crops.CAN_LOOK_UP_IN_REGISTERS:
        pairs["write_block, write_border (a crop)"] = _crops(kept), 1
    print(f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, {binding.get_host_cpu_name()}\n")
    print("| operation | hand-written [ns] | plain numba [ns] | ratio (range) |\n|---|---|---|---|")
    for name, (runs, units) in pairs.items():
        if names and name not in names:
            continue
        contenders = {form: repeated(run, units) for form, run in zip(("text", "plain"), runs, strict=True)}
        seconds = interleaved(contenders, effort)
        text, plain = (1e9 * statistics.median(seconds[form]) for form in ("text", "plain"))
        ratio = compared(seconds["text"], seconds["plain"])
        print(
            f"| {name} | {text:.1f} | {plain:.1f} | {ratio.median:.2f} ({ratio.least:.2f}-{ratio.greatest:.2f}) |",
            flush=True,
        )


if __name__ == "__main__":
    main()
