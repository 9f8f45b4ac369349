"""Simulated Modbus device with a sample feed; correct and faulty replies to requests."""

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from acquisition.simulated.feed import Ledger, SampleFeed, SlotFeed
from core.samples.blocks import SampleBlock

_ADDRESS_AND_COUNT = struct.Struct(">HH")
_ADDRESS = struct.Struct(">H")
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
_MAX_REGISTERS, _MAX_BITS = 125, 2000
_MEI_READ_IDENTIFICATION = 14
_BASIC_CONFORMITY = 0x81

_LAST_LOOKS = 2
"""Number of reads without new data after which an ended device is `drained`. The second of these
reads shows that the client has received the reply to the first."""


class ModbusDevice(ABC):
    """Simulated Modbus device with read-only registers, bits and queues.

    The feed is divided into steps, which begin at multiples of their length. In a gap of the feed
    the device produces no data; at the end of the feed it keeps its last data.

    Parameters
    ----------
    feed
        Source of the samples.
    step_samples
        Number of samples per channel in a step, which are produced together.
    unit
        Name of the unit in `ledger`, which counts the produced samples.
    ledger
        Count of the produced samples; a new one if None.

    Attributes
    ----------
    identification
        Device identification objects by number, as bytes; if empty, function 43/14 is refused.
    frozen
        Whether the production of data is stopped; the device still replies.
    on_demand
        Whether the device produces data when a client that has read all data reads again.
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
        """Duration of one step in seconds."""

    @property
    def drained(self) -> bool:
        """Whether the feed has ended, and clients have read twice without new data."""
        return self.ended and self._n_looks >= _LAST_LOOKS

    @property
    def faults(self) -> Mapping[str, Callable[[int], None]]:
        """Functions that inject faults of the data, by fault name; their argument is a count."""
        return {"freeze": self._freeze}

    def spoil(self, fault: str, count: int) -> None:
        """Inject a fault of the data `count` times; `fault` is a key of `faults`."""
        self.faults[fault](count)

    def produce(self, n_steps: int = 1) -> None:
        """Advance the time of the device by `n_steps` steps, and produce the data unless frozen."""
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
        """Return `count` registers as big-endian words; None if an address does not exist."""
        return None

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:  # noqa: ARG002
        """Return `count` bits packed in bytes, low bit first; None if an address does not exist."""
        return None

    def read_fifo(self, address: int) -> bytes | None:  # noqa: ARG002
        """Return the registers of the queue at an address; None if no queue has this address."""
        return None

    @abstractmethod
    def _show(self, raw: SampleBlock) -> None:
        """Write the data of a step to the registers or queues."""

    def _take(self) -> None:
        """Take the next step from the feed and write its data."""
        raw = self._feed.take()
        if raw is not None:
            self._show(raw)
            self._position, self._feed_epoch = self._feed.number(raw), raw.epoch

    def _must_wait(self, ahead: SampleBlock) -> bool:  # noqa: ARG002
        """Return whether the step `ahead` must wait until a client has read previous data."""
        return False

    def _freeze(self, count: int) -> None:
        self._n_frozen += count


def answer(request: bytes, device: ModbusDevice) -> bytes:
    """Return the reply PDU to a request PDU; an exception reply if the data are not readable."""
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
    """Return the Modbus exception reply to a function, with an exception code."""
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
    """Memory of a contiguous range of registers.

    Parameters
    ----------
    start
        Address of the first register.
    n_registers
        Number of registers; other addresses do not exist.

    Attributes
    ----------
    before_read
        Function that is called with address and count before each read, so that a test can change
        the device between two requests; None calls nothing.
    """

    def __init__(self, start: int, n_registers: int) -> None:
        self._start = start
        self._data = bytearray(2 * n_registers)
        self.before_read: Callable[[int, int], None] | None = None

    def write(self, address: int, data: bytes) -> None:
        """Write big-endian words to consecutive registers, beginning at `address`.

        Raises ValueError if a register does not exist; the message contains the requested and the
        valid range.
        """
        offset = 2 * (address - self._start)
        if offset < 0 or offset + len(data) > len(self._data):
            raise ValueError(
                f"registers {address} to {address + len(data) // 2 - 1} are not within"
                f" {self._start} to {self._start + len(self._data) // 2 - 1}"
            )
        self._data[offset : offset + len(data)] = data

    def clear(self) -> None:
        """Set all registers to zero, as at power-up."""
        self._data[:] = bytes(len(self._data))

    def read(self, address: int, count: int) -> bytes | None:
        """Return `count` registers as big-endian words; None if a register does not exist."""
        if self.before_read is not None:
            self.before_read(address, count)
        offset = 2 * (address - self._start)
        if offset < 0 or offset + 2 * count > len(self._data):
            return None
        return bytes(self._data[offset : offset + 2 * count])


Answerer: TypeAlias = Callable[[bytes], bytes]
ReplyFault: TypeAlias = Callable[[bytes, Answerer], bytes | None]
"""Function of a request PDU, and of the function that answers requests correctly.

Returns the faulty reply PDU, or None for no reply."""

_DEVICE_FAILURE, _BUSY = 4, 6
_EXCEPTION_CODES = (1, 2, 3, 4, 5, 6, 8, 10, 11)
_REGISTER_FUNCTIONS = (3, 4)


class HangUpError(Exception):
    """Error raised if the device closes the connection instead of sending a reply."""


def _hanging_up(request: bytes, answerer: Answerer) -> bytes:  # noqa: ARG001
    """Raise `HangUpError`, so that the server closes the connection without a reply."""
    raise HangUpError


def refusing(code: int) -> ReplyFault:
    """Return a reply fault that answers with a Modbus exception code."""
    return lambda request, _: refusal(request[0], code)


def _shifted_map(request: bytes, answerer: Answerer) -> bytes:
    """Return a reply with the data of the next address, as after a firmware change."""
    address = int.from_bytes(request[1:3], "big") + 1
    return answerer(request[:1] + (address & 0xFFFF).to_bytes(2, "big") + request[3:])


def _swapped_words(request: bytes, answerer: Answerer) -> bytes:
    """Return the correct reply with the two words of each pair of registers exchanged."""
    reply = answerer(request)
    n_pairs = (len(reply) - 2) // 4
    if reply[0] not in _REGISTER_FUNCTIONS or not n_pairs:
        return reply
    words = np.frombuffer(reply, ">u2", 2 * n_pairs, 2).reshape(n_pairs, 2)
    return reply[:2] + words[:, ::-1].tobytes() + reply[2 + 4 * n_pairs :]


REPLY_FAULTS: Mapping[str, ReplyFault] = {
    "busy": refusing(_BUSY),
    "cut": _hanging_up,
    "exception": refusing(_DEVICE_FAILURE),
    **{f"exception_{code}": refusing(code) for code in _EXCEPTION_CODES},
    "shift_map": _shifted_map,
    "silent": lambda _request, _answerer: None,
    "word_order": _swapped_words,
}
