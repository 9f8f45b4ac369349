"""`ReadPlan`: requests that read all cells of a register map, as few as possible."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquisition.errors import ConfigError
from acquisition.modbus.cells import BITS_PER_REGISTER, Cell
from acquisition.modbus.register_map import RegisterMap, Together
from acquisition.modbus.requests import BIT_FUNCTIONS, Span


class MapError(ConfigError):
    """Error raised if the cells of a register map cannot be read as the map requires.

    `at` is the path of the faulty field in the map: field names and element numbers.
    """

    def __init__(self, message: str, *at: int | str) -> None:
        super().__init__(message)
        self.at = at


@dataclass(frozen=True)
class ReadPlan:
    """Ranges of registers or bits to read in one poll, in order, each by one request.

    Cells, at addresses from `base` on, are located in the concatenated contents of the ranges.
    """

    spans: tuple[Span, ...]
    base: int

    def span_of(self, cell: Cell) -> Span:
        """Return the range, read by one request, that contains a cell of the planned map."""
        start, stop = cell.start(self.base), cell.stop(self.base)
        return next(
            span
            for span in self.spans
            if span.function == cell.function and span.address <= start and stop <= span.stop
        )

    def place_of(self, cell: Cell) -> tuple[int, int]:
        """Return the position of a cell's first byte in the concatenated contents, and its bit.

        The bit is 0 for registers.
        """
        span = self.span_of(cell)
        n_before = sum(s.n_bytes for s in self.spans[: self.spans.index(span)])
        places = cell.start(self.base) - span.address
        if cell.function in BIT_FUNCTIONS:
            return n_before + places // 8, places % 8
        return n_before + 2 * places, 0


Stretch = tuple[int, int]
"""Address range that must be read in one request: first address, address after the last."""


def plan_reads(registers: RegisterMap) -> ReadPlan:
    """Return the plan of the requests that read a register map in every poll.

    Raises MapError if a number lies partly outside a block of registers that must be read in one
    request, or if a value and its scale register are in different requests.
    """
    plan = _plan(registers, list(registers.cells()), registers.together)
    for n, value in enumerate(registers.values):
        scale = value.scale_register
        if scale is None or plan.span_of(value.cell) == plan.span_of(scale.cell):
            continue
        first = min(value.cell.address, scale.cell.address)
        raise MapError(
            "must be read in the same request as its value; add a [[together]] table with"
            f" address = {first}",
            *("value", n, "scale_register"),
        )
    return plan


def plan_signature(registers: RegisterMap) -> ReadPlan:
    """Return the plan of the requests that read the signature cells of a register map."""
    return _plan(registers, [signature.cell for signature in registers.signature], ())


def _plan(registers: RegisterMap, cells: Sequence[Cell], together: Sequence[Together]) -> ReadPlan:
    spans: list[Span] = []
    for function in sorted({cell.function for cell in cells}):
        stretches = [
            (cell.start(registers.base), cell.stop(registers.base))
            for cell in cells
            if cell.function == function
        ]
        blocks = [
            (block.address - registers.base, block.address - registers.base + block.count)
            for block in together
            if block.function == function
        ]
        is_bits = function in BIT_FUNCTIONS
        most = registers.max_registers * (BITS_PER_REGISTER if is_bits else 1)
        # ranges that share a register are read in one request
        whole = _merged([*stretches, *_wanted(blocks, stretches, registers)], max_gap=-1)
        spans += [
            Span(start, stop - start, function)
            for start, stop in _merged(whole, registers.max_gap, most)
        ]
    return ReadPlan(tuple(spans), registers.base)


def _wanted(
    blocks: Sequence[Stretch], stretches: Sequence[Stretch], registers: RegisterMap
) -> list[Stretch]:
    """Return the blocks that contain a cell; raise MapError if blocks overlap or cut a cell."""
    for (_, stop), (start, _) in pairwise(sorted(blocks)):
        if start < stop:
            raise MapError(
                f"two blocks contain register {start + registers.base}; blocks must not overlap",
                "together",
            )
    for start, stop in stretches:
        for first, last in blocks:
            if start < last and first < stop and not first <= start < stop <= last:
                raise MapError(
                    f"the block from register {first + registers.base} contains only a part of the"
                    f" value at register {start + registers.base}; extend the block",
                    "together",
                )
    return [b for b in blocks if any(b[0] <= start < b[1] for start, _ in stretches)]


def _merged(stretches: Iterable[Stretch], max_gap: int, most: float = math.inf) -> list[Stretch]:
    """Merge ranges with gaps up to `max_gap` into ranges of up to `most` addresses.

    Ranges that share a register have a gap of -1 or less. Merging from the lowest address on gives
    the fewest ranges.
    """
    merged: list[Stretch] = []
    for start, stop in sorted(stretches):
        first, last = merged[-1] if merged else (start, start)
        if merged and start - last <= max_gap and max(last, stop) - first <= most:
            merged[-1] = (first, max(last, stop))
        else:
            merged.append((start, stop))
    return merged
