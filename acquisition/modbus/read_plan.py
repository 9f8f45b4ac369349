"""`ReadPlan`: the fewest requests that read all cells of a map, and no register beside them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquisition.errors import ConfigError
from acquisition.modbus.cells import BITS_PER_REGISTER, Cell
from acquisition.modbus.register_map import RegisterMap, Together
from acquisition.modbus.requests import BIT_FUNCTIONS, Span


class MapError(ConfigError):
    """A register map that cannot be read as it demands.

    Parameters
    ----------
    at
        Where in the map: field names and element numbers.
    """

    def __init__(self, message: str, *at: int | str) -> None:
        super().__init__(message)
        self.at = at


@dataclass(frozen=True)
class ReadPlan:
    """Spans in the order in which they are read, each by one request.

    Their contents, one after the other, are the bytes that cells are found in.
    """

    spans: tuple[Span, ...]
    base: int

    def span_of(self, cell: Cell) -> Span:
        """Span that holds a cell."""
        start, stop = cell.start(self.base), cell.stop(self.base)
        return next(
            span
            for span in self.spans
            if span.function == cell.function and span.address <= start and stop <= span.stop
        )

    def place_of(self, cell: Cell) -> tuple[int, int]:
        """Byte of all contents where a cell begins, and bit of it for functions 1 and 2."""
        span = self.span_of(cell)
        n_before = sum(s.n_bytes for s in self.spans[: self.spans.index(span)])
        places = cell.start(self.base) - span.address
        if cell.function in BIT_FUNCTIONS:
            return n_before + places // 8, places % 8
        return n_before + 2 * places, 0


Stretch = tuple[int, int]
"""First address, and first one after it; must be read as a whole."""


def plan_reads(registers: RegisterMap) -> ReadPlan:
    """Plan the reads of a map.

    Raises
    ------
    MapError
        If a cell lies across the edge of a block that must be read as one, or a value and its
        scale register are not read together.
    """
    plan = _plan(registers, list(registers.cells()), registers.together)
    for n, value in enumerate(registers.values):
        scale = value.scale_register
        if scale is None or plan.span_of(value.cell) == plan.span_of(scale.cell):
            continue
        first = min(value.cell.address, scale.cell.address)
        raise MapError(
            "is read in another request than its value, so that they may not belong together;"
            f" read both as one block: [[together]] with address = {first}",
            *("value", n, "scale_register"),
        )
    return plan


def plan_signature(registers: RegisterMap) -> ReadPlan:
    """Plan the reads of a map's signature."""
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
        whole = _whole([*stretches, *_wanted(blocks, stretches, registers)])
        spans += [
            Span(start, stop - start, function)
            for start, stop in _packed(whole, registers.max_gap, most)
        ]
    return ReadPlan(tuple(spans), registers.base)


def _wanted(
    blocks: Sequence[Stretch], stretches: Sequence[Stretch], registers: RegisterMap
) -> list[Stretch]:
    """Blocks that hold at least one cell that is read."""
    for (_, stop), (start, _) in pairwise(sorted(blocks)):
        if start < stop:
            raise MapError(
                f"two blocks share register {start + registers.base}; each register is in one",
                "together",
            )
    for start, stop in stretches:
        for first, last in blocks:
            if start < last and first < stop and not first <= start < stop <= last:
                raise MapError(
                    f"the block from {first + registers.base} cuts the number at"
                    f" {start + registers.base} in two",
                    "together",
                )
    return [b for b in blocks if any(b[0] <= start < b[1] for start, _ in stretches)]


def _whole(stretches: Iterable[Stretch]) -> list[Stretch]:
    """Join stretches that share a register: they have to be read as a whole."""
    joined: list[Stretch] = []
    for start, stop in sorted(stretches):
        if joined and start < joined[-1][1]:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined


def _packed(stretches: Sequence[Stretch], max_gap: int, most: int) -> list[Stretch]:
    """Put neighbours into one request while they fit; from left to right this needs the fewest."""
    packed: list[Stretch] = []
    for start, stop in stretches:
        if packed and start - packed[-1][1] <= max_gap and stop - packed[-1][0] <= most:
            packed[-1] = (packed[-1][0], stop)
        else:
            packed.append((start, stop))
    return packed
