"""What rays that travel in lanes share: groups of lanes, axes, and the table of squares."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils

from lidarium.mapping.kernels.processor import has_feature

GROUP = 16
"""Lanes of a group."""

GROUPS = 2
"""Groups that travel at once."""

RAYS = GROUPS * GROUP
"""Rays, or bundles, that travel at once."""

FLOAT = 8
"""Bytes of a float64."""

BEHIND = 3
"""Bytes behind the table of squares that are read, and not used."""

HAS_GATHERS = has_feature("avx512f")
"""Whether the processor looks up sixteen places at once in registers that are wide enough."""

INT, _FLAG = ir.IntType(32), ir.IntType(1)
INTS, REALS = ir.VectorType(INT, GROUP), ir.VectorType(ir.DoubleType(), GROUP)
FLAGS, _LONGS = ir.VectorType(_FLAG, GROUP), ir.VectorType(ir.IntType(64), GROUP)
ZEROS, ONES = ir.Constant(INTS, [0] * GROUP), ir.Constant(INTS, [1] * GROUP)
_BYTE, NO_REALS = ir.Constant(INTS, [255] * GROUP), ir.Constant(REALS, [0.0] * GROUP)

_insert: Any = cgutils.get_or_insert_function


def spread(builder: Any, value: Any, kind: Any) -> Any:  # noqa: ANN401
    """Repeat a number in all lanes."""
    nothing = ir.Constant(kind, ir.Undefined)
    lone = builder.insert_element(nothing, value, ir.Constant(INT, 0))
    return builder.shuffle_vector(lone, nothing, ZEROS)


def larger(builder: Any, value: Any, other: Any) -> Any:  # noqa: ANN401
    """Return the larger of two integers in each lane."""
    return builder.select(builder.icmp_signed(">", value, other), value, other)


def smaller(builder: Any, value: Any, other: Any) -> Any:  # noqa: ANN401
    """Return the smaller of two integers in each lane."""
    return builder.select(builder.icmp_signed("<", value, other), value, other)


def cells_at(builder: Any, start: Any, direction: Any, distance: Any) -> Any:  # noqa: ANN401
    """Return the cells at a distance along rays, on one axis."""
    return builder.fptosi(builder.fadd(start, builder.fmul(distance, direction)), INTS)


def gather(builder: Any, address: Any, places: Any, alive: Any) -> Any:  # noqa: ANN401
    """Return the four bytes from each place on; 0 in lanes that are not alive."""
    if HAS_GATHERS:
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(INTS, [INTS, pointer, INTS, FLAGS, INT])
        function = _insert(builder.module, kind, "llvm.x86.avx512.mask.gather.dpi.512")
        table = builder.inttoptr(address, pointer)
        return builder.call(function, [ZEROS, table, places, alive, ir.Constant(INT, 1)])
    pointers = ir.VectorType(INT.as_pointer(), GROUP)
    kind = ir.FunctionType(INTS, [pointers, FLAGS, INTS])
    function = _insert(builder.module, kind, f"llvm.masked.gather.v{GROUP}i32.v{GROUP}p0")
    addresses = builder.add(builder.zext(places, _LONGS), spread(builder, address, _LONGS))
    return builder.call(function, [builder.inttoptr(addresses, pointers), alive, ZEROS])


class Rows:
    """Numbers of a group of lanes: rows of float64 at an address."""

    def __init__(self, builder: Any, address: Any, stride: Any, group: int) -> None:  # noqa: ANN401
        self._builder, self._stride = builder, stride
        self._address = builder.add(address, ir.Constant(address.type, group * GROUP * FLOAT))

    def pointer(self, row: int) -> Any:  # noqa: ANN401
        """Return where a row begins."""
        offset = self._builder.mul(self._stride, ir.Constant(self._stride.type, row))
        return self._builder.inttoptr(self._builder.add(self._address, offset), REALS.as_pointer())

    def load(self, row: int) -> Any:  # noqa: ANN401
        """Return the numbers of a row."""
        return self._builder.load(self.pointer(row), align=FLOAT)


class Axis:
    """One axis of a group: where its rays begin, and their directions and inverses along it."""

    def __init__(self, builder: Any, start: Any, direction: Any, inverse: Any) -> None:  # noqa: ANN401
        self._builder, self.start = builder, spread(builder, start, REALS)
        self.direction, self._inverse = direction, inverse
        self.is_backward = builder.fcmp_ordered("<", direction, NO_REALS)
        # -1 for backward and 0 for forward: what turns a number of cells around, and makes steps of it.
        self.turn = builder.sext(self.is_backward, INTS)
        self._forward = builder.add(self.turn, ONES)

    def cells(self, distance: Any) -> Any:  # noqa: ANN401
        """Return the cells at a distance along the rays."""
        return cells_at(self._builder, self.start, self.direction, distance)

    def border(self, cells: Any, side: Any) -> Any:  # noqa: ANN401
        """Return the far borders of squares that open from cells."""
        # side - 1 forward and -side backward: one more is the border as seen from the cell.
        ahead = self._builder.xor(self._builder.sub(side, ONES), self.turn)
        return self._builder.add(self._builder.add(cells, ONES), ahead)

    def distance(self, border: Any) -> Any:  # noqa: ANN401
        """Return the distances at which the rays are at borders."""
        place = self._builder.sitofp(border, REALS)
        return self._builder.fmul(self._builder.fsub(place, self.start), self._inverse)

    def before(self, border: Any) -> Any:  # noqa: ANN401
        """Return the cells before borders."""
        return self._builder.sub(border, self._forward)

    def behind(self, border: Any) -> Any:  # noqa: ANN401
        """Return the cells behind borders."""
        return self._builder.add(border, self.turn)


class Squares:
    """The table of squares, as the lanes of a group look it up: four planes of rows."""

    def __init__(self, builder: Any, address: Any, shape: Any, across: Axis, up: Axis) -> None:  # noqa: ANN401
        plane, columns = (
            spread(builder, builder.trunc(builder.extract_value(shape, place), INT), INTS)
            for place in range(2)
        )
        self._builder, self._address, self._columns = builder, address, columns
        left, down = builder.and_(across.turn, plane), builder.and_(up.turn, builder.add(plane, plane))
        self._offset = builder.add(left, down)

    def sides(self, column: Any, row: Any, alive: Any) -> Any:  # noqa: ANN401
        """Return the side of the largest square that opens from each lane's cell."""
        within = self._builder.add(self._builder.mul(row, self._columns), column)
        found = gather(self._builder, self._address, self._builder.add(self._offset, within), alive)
        return self._builder.and_(found, _BYTE)


Advance = Callable[[Any, Any], tuple[Any, Any]]


def _is_any_alive(builder: Any, alive: Sequence[Any]) -> Any:  # noqa: ANN401
    word = ir.IntType(GROUP)
    either = builder.bitcast(functools.reduce(builder.or_, alive), word)
    return builder.icmp_unsigned("!=", either, ir.Constant(word, 0))


def travel_groups(
    builder: Any,  # noqa: ANN401
    starts: Sequence[Sequence[Any]],
    alive: Sequence[Any],
    advances: Sequence[Advance],
) -> list[Any]:
    """Advance two groups while a lane is alive; return the first number of each group's state."""
    before = builder.basic_block
    loop, after = builder.append_basic_block("travel"), builder.append_basic_block("arrived")
    builder.cbranch(_is_any_alive(builder, alive), loop, after)
    builder.position_at_end(loop)
    states = [[builder.phi(value.type) for value in start] for start in starts]
    masks = [builder.phi(FLAGS) for _ in alive]
    moved = [advance(*each) for advance, *each in zip(advances, states, masks, strict=True)]
    builder.cbranch(_is_any_alive(builder, [mask for _, mask in moved]), loop, after)
    builder.position_at_end(after)
    ends = []
    for (new, new_mask), state, mask, start, first in zip(moved, states, masks, starts, alive, strict=True):
        for phi, old, value in zip([*state, mask], [*start, first], [*new, new_mask], strict=True):
            phi.add_incoming(old, before)
            phi.add_incoming(value, loop)
        end = builder.phi(REALS)
        end.add_incoming(start[0], before)
        end.add_incoming(new[0], loop)
        ends.append(end)
    return ends
