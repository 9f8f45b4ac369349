"""`ModbusDevice`: a sample feed behind registers; its replies to requests, right and faulty."""

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from acquisition.delivery.blocks import RawBlock
from acquisition.simulated.feed import Ledger, SampleFeed, SlotFeed

_ADDRESS_AND_COUNT = struct.Struct(">HH")
_ADDRESS = struct.Struct(">H")
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_MAX_REGISTERS, _MAX_BITS = 125, 2000
_MEI_READ_IDENTIFICATION = 14
_BASIC_CONFORMITY = 0x81

_LAST_LOOKS = 2
"""A reader that looks a second time has received the answer to the first, and all data before."""


class ModbusDevice(ABC):
    """Simulated device whose registers, bits and queues can only be read.

    The feed is cut into steps that begin at multiples of their length. In a gap of the feed time
    passes without data; at its end the device stands still.

    Parameters
    ----------
    feed
        Source of the samples.
    step_samples
        Samples that are produced together.
    unit
        Name of the unit in the ledger.

    Attributes
    ----------
    identification
        Objects of function 43/14 by number; without any the function is unknown.
    frozen
        While set, no data are produced; the device still answers.
    on_demand
        Whether the device produces when its reader has read all data and looks for more.
    ended
        Whether the feed has ended.
    """

    def __init__(
        self, feed: SampleFeed, step_samples: int, unit: str, ledger: Ledger | None
    ) -> None:
        self._feed = SlotFeed(feed, step_samples)
        self._unit = unit
        self.ledger = ledger or Ledger()
        self.identification: Mapping[int, bytes] = {}
        self.frozen = self.on_demand = self.ended = False
        self._n_frozen = self._n_looks = self._position = self._feed_epoch = 0

    @property
    @abstractmethod
    def step_s(self) -> float:
        """Duration of one step."""

    @property
    def drained(self) -> bool:
        """Whether the feed has ended and a reader has read everything and looked again."""
        return self.ended and self._n_looks >= _LAST_LOOKS

    @property
    def faults(self) -> Mapping[str, Callable[[int], None]]:
        """Faults of the data; each takes a count of steps."""
        return {"freeze": self._freeze}

    def spoil(self, fault: str, count: int) -> None:
        """Cause a fault of the data, `count` times."""
        self.faults[fault](count)

    def produce(self, n_steps: int = 1) -> None:
        """Let time pass, in steps."""
        for _ in range(0 if self.frozen else n_steps):
            if self._n_frozen:
                self._n_frozen -= 1
                continue
            ahead = self._feed.peek()
            if ahead is None:
                self.ended = True
                return
            if self._must_wait(ahead):
                return
            self._position += 1
            if ahead.epoch != self._feed_epoch or self._feed.number(ahead) <= self._position:
                self._take()

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:  # noqa: ARG002
        """Big-endian words by function 3 or 4, or None if some do not exist."""
        return None

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:  # noqa: ARG002
        """Eight bits a byte by function 1 or 2, or None if some do not exist."""
        return None

    def read_fifo(self, address: int) -> bytes | None:  # noqa: ARG002
        """Registers of a queue, or None if there is no queue."""
        return None

    @abstractmethod
    def _show(self, raw: RawBlock) -> None:
        """Make a step readable."""

    def _take(self) -> None:
        """Take the next step from the feed and show it."""
        raw = self._feed.take()
        if raw is not None:
            self._show(raw)
            self._position, self._feed_epoch = self._feed.number(raw), raw.epoch

    def _must_wait(self, ahead: RawBlock) -> bool:  # noqa: ARG002
        """Whether the next step must not come yet."""
        return False

    def _freeze(self, count: int) -> None:
        self._n_frozen += count


def answer(request: bytes, device: ModbusDevice) -> bytes:
    """Reply to a request, each from function code on; an exception to all but readable data."""
    function, data = request[0], request[1:]
    match function:
        case 1 | 2 | 3 | 4 if len(data) == _ADDRESS_AND_COUNT.size:
            return _counted(function, data, device)
        case 0x18 if len(data) == _ADDRESS.size:
            return _fifo(data, device)
        case 43 if len(data) == 3 and data[0] == _MEI_READ_IDENTIFICATION and device.identification:
            return _identification(data, device.identification)
    return refusal(function, _ILLEGAL_FUNCTION)


def refusal(function: int, code: int) -> bytes:
    """Exception reply."""
    return bytes((function | 0x80, code))


def _counted(function: int, data: bytes, device: ModbusDevice) -> bytes:
    address, count = _ADDRESS_AND_COUNT.unpack(data)
    of_bits = function in (1, 2)
    if not 1 <= count <= (_MAX_BITS if of_bits else _MAX_REGISTERS):
        return refusal(function, _ILLEGAL_VALUE)
    read = device.read_bits if of_bits else device.read_registers
    values = read(function, address, count)
    if values is None:
        return refusal(function, _ILLEGAL_ADDRESS)
    return bytes((function, len(values))) + values


def _fifo(data: bytes, device: ModbusDevice) -> bytes:
    values = device.read_fifo(_ADDRESS.unpack(data)[0])
    if values is None:
        return refusal(0x18, _ILLEGAL_ADDRESS)
    return struct.pack(">BHH", 0x18, 2 + len(values), len(values) // 2) + values


def _identification(data: bytes, objects: Mapping[int, bytes]) -> bytes:
    asked = {number: value for number, value in sorted(objects.items()) if number >= data[2]}
    body = b"".join(bytes((number, len(value))) + value for number, value in asked.items())
    head = bytes((43, _MEI_READ_IDENTIFICATION, data[1], _BASIC_CONFORMITY, 0, 0, len(asked)))
    return head + body


class RegisterMemory:
    """A stretch of readable registers.

    Parameters
    ----------
    start
        Address of the first register.
    n_registers
        Number of registers; all others do not exist.

    Attributes
    ----------
    before_read
        Called with address and count before each read; lets a test change the device between two
        requests.
    """

    def __init__(self, start: int, n_registers: int) -> None:
        self._start = start
        self._data = bytearray(2 * n_registers)
        self.before_read: Callable[[int, int], None] | None = None

    def write(self, address: int, data: bytes) -> None:
        """Store big-endian words.

        Raises
        ------
        ValueError
            If some registers do not exist; the message gives both ranges.
        """
        offset = 2 * (address - self._start)
        if offset < 0 or offset + len(data) > len(self._data):
            raise ValueError(
                f"registers {address} to {address + len(data) // 2} are not in"
                f" {self._start} to {self._start + len(self._data) // 2}"
            )
        self._data[offset : offset + len(data)] = data

    def clear(self) -> None:
        """Set all registers to zero, as after power-up."""
        self._data[:] = bytes(len(self._data))

    def read(self, address: int, count: int) -> bytes | None:
        """Return big-endian words, or None if some of these registers do not exist."""
        if self.before_read is not None:
            self.before_read(address, count)
        offset = 2 * (address - self._start)
        if offset < 0 or offset + 2 * count > len(self._data):
            return None
        return bytes(self._data[offset : offset + 2 * count])


Answerer: TypeAlias = Callable[[bytes], bytes]
ReplyFault: TypeAlias = Callable[[bytes, Answerer], bytes | None]
"""Maps a request and the function that answers it to the reply; None for silence."""

_DEVICE_FAILURE, _BUSY = 4, 6
_EXCEPTION_CODES = (1, 2, 3, 4, 5, 6, 8, 10, 11)
_REGISTER_FUNCTIONS = (3, 4)


class HangUpError(Exception):
    """The device closes the connection instead of answering."""


def hanging_up(request: bytes, answerer: Answerer) -> bytes:  # noqa: ARG001
    """Close the connection."""
    raise HangUpError


def refusing(code: int) -> ReplyFault:
    """Answer with an exception."""
    return lambda request, _: refusal(request[0], code)


def shifted_map(request: bytes, answerer: Answerer) -> bytes:
    """Answer with the data one register further, as after a change of firmware."""
    address = int.from_bytes(request[1:3], "big") + 1
    return answerer(request[:1] + (address & 0xFFFF).to_bytes(2, "big") + request[3:])


def swapped_words(request: bytes, answerer: Answerer) -> bytes:
    """Exchange the two words of each doubleword of a register reply."""
    reply = answerer(request)
    n_pairs = (len(reply) - 2) // 4
    if reply[0] not in _REGISTER_FUNCTIONS or not n_pairs:
        return reply
    words = np.frombuffer(reply, ">u2", 2 * n_pairs, 2).reshape(n_pairs, 2)
    return reply[:2] + words[:, ::-1].tobytes() + reply[2 + 4 * n_pairs :]


REPLY_FAULTS: Mapping[str, ReplyFault] = {
    "busy": refusing(_BUSY),
    "cut": hanging_up,
    "exception": refusing(_DEVICE_FAILURE),
    **{f"exception_{code}": refusing(code) for code in _EXCEPTION_CODES},
    "shift_map": shifted_map,
    "silent": lambda _request, _answerer: None,
    "word_order": swapped_words,
}
