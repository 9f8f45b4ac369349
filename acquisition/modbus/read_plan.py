"""`ReadPlan`: the fewest requests that read all cells of a map and nothing it does not name."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from acquisition.modbus.cells import BIT_FUNCTIONS, BITS_PER_REGISTER, Cell, MapError
from acquisition.modbus.register_map import RegisterMap, Together


@dataclass(frozen=True)
class ReadRequest:
    """One read; addresses count from 0, as on the wire, in bits for functions 1 and 2."""

    function: int
    start: int
    count: int

    @property
    def stop(self) -> int:
        """First address after it."""
        return self.start + self.count

    @property
    def n_bytes(self) -> int:
        """Bytes of its reply."""
        return -(-self.count // 8) if self.function in BIT_FUNCTIONS else 2 * self.count

    def holds(self, function: int, start: int, stop: int) -> bool:
        """Whether these addresses are in it."""
        return self.function == function and self.start <= start and stop <= self.stop


@dataclass(frozen=True)
class ReadPlan:
    """Requests in the order in which they are sent.

    Their replies, one after the other, are the bytes that cells are found in.
    """

    requests: tuple[ReadRequest, ...]
    base: int

    def request_of(self, cell: Cell) -> int:
        """Which request reads a cell."""
        start, stop = cell.start(self.base), cell.stop(self.base)
        return next(n for n, r in enumerate(self.requests) if r.holds(cell.function, start, stop))

    def byte_of(self, cell: Cell) -> int:
        """Where a cell begins in the bytes of all replies."""
        number = self.request_of(cell)
        request, before = self.requests[number], self.requests[:number]
        places = cell.start(self.base) - request.start
        offset = places // 8 if cell.function in BIT_FUNCTIONS else 2 * places
        return sum(r.n_bytes for r in before) + offset

    def bit_of(self, cell: Cell) -> int:
        """Which bit of its byte a cell of functions 1 and 2 is."""
        return (cell.start(self.base) - self.requests[self.request_of(cell)].start) % 8


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
    plan = _plan(registers, [cell for cell, _ in registers.cells()], registers.together)
    for n, value in enumerate(registers.values):
        scale = value.scale_register
        if scale is None or plan.request_of(value.cell) == plan.request_of(scale.cell):
            continue
        first = min(value.cell.address, scale.cell.address)
        raise MapError(
            "is read in another request than its value, so that they may not belong together;"
            f" read both as one block: [[together]] with address = {first}",
            *("value", n, "scale_register"),
        )
    return plan


def plan_signature(registers: RegisterMap) -> ReadPlan:
    """Plan the reads that tell a device from others."""
    return _plan(registers, [signature.cell for signature in registers.signature], ())


def _plan(registers: RegisterMap, cells: Sequence[Cell], together: Sequence[Together]) -> ReadPlan:
    requests: list[ReadRequest] = []
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
        requests += [
            ReadRequest(function, start, stop - start)
            for start, stop in _packed(
                _whole([*stretches, *_wanted(blocks, stretches, registers)]),
                registers.max_gap,
                most,
            )
        ]
    return ReadPlan(tuple(requests), registers.base)


def _wanted(
    blocks: Sequence[Stretch], stretches: Sequence[Stretch], registers: RegisterMap
) -> list[Stretch]:
    """Blocks of which something is read at all."""
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
    """Join what shares a register: it has to be read as a whole."""
    joined: list[Stretch] = []
    for start, stop in sorted(stretches):
        if joined and start < joined[-1][1]:
            joined[-1] = (joined[-1][0], max(stop, joined[-1][1]))
        else:
            joined.append((start, stop))
    return joined


def _packed(stretches: Sequence[Stretch], max_gap: int, most: int) -> list[Stretch]:
    """Put neighbours into one request as long as they fit: from left to right, that is fewest."""
    packed: list[Stretch] = []
    for start, stop in stretches:
        if packed and start - packed[-1][1] <= max_gap and stop - packed[-1][0] <= most:
            packed[-1] = (packed[-1][0], stop)
        else:
            packed.append((start, stop))
    return packed
