"""Where a Modbus device is: at a TCP address, or on a serial line."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import count
from typing import Literal, TypeAlias, get_args

from acquisition.delivery.network import KnownAddresses
from acquisition.errors import ConfigError
from acquisition.modbus.identity import Identity

Parity: TypeAlias = Literal["none", "even", "odd"]

MAX_REGISTERS_PER_READ = 125
ADDRESS_SPACE = 0x10000
_MAX_REQUESTS_IN_FLIGHT = 16
_N_TRANSACTIONS = 65_000
"""Ids are 1 to this; some devices answer to 0 as to any."""

_MIN_BAUDRATE, _MAX_BAUDRATE = 300, 4_000_000
_MAX_SERIAL_DEVICE_ID = 247
_BITS_AROUND_A_CHARACTER = 9  # a start bit and eight of data
_FRAME_GAP_CHARACTERS = 3.5
_SHORTEST_FRAME_GAP_S = 0.00175
"""Modbus over Serial Line 1.02, 2.5.1.1: above 19,200 Bd the gap between frames stays this."""


@dataclass(frozen=True, kw_only=True)
class TcpTransport:
    """A Modbus TCP device.

    Parameters
    ----------
    host
        Name or address.
    port
        1 to 65535.

    Attributes
    ----------
    addresses
        Of the host, remembered from one connection to the next.
    transactions
        Id of each next request. They go on from one connection to the next: a gateway may pass a
        late reply on to whoever is connected then.
    """

    host: str
    port: int = 502
    addresses: KnownAddresses = field(init=False, repr=False, compare=False)
    transactions: Iterator[int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        _require("port", self.port, 1, 65535)
        object.__setattr__(self, "addresses", KnownAddresses(self.host, self.port))
        object.__setattr__(self, "transactions", (1 + n % _N_TRANSACTIONS for n in count()))

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, kw_only=True)
class SerialTransport:
    """A serial line with Modbus RTU on it; always eight data bits.

    Parameters
    ----------
    device
        Path of the port; example: "/dev/ttyUSB0".
    baudrate
        300 to 4,000,000 bit/s.
    parity
        "none", "even" or "odd".
    stop_bits
        1 or 2.
    """

    device: str
    baudrate: int = 19_200
    parity: Parity = "even"
    stop_bits: Literal[1, 2] = 1

    def __post_init__(self) -> None:
        _require("baudrate", self.baudrate, _MIN_BAUDRATE, _MAX_BAUDRATE)
        _require("stop_bits", self.stop_bits, 1, 2)
        if self.parity not in get_args(Parity):
            raise ConfigError(
                f"modbus: parity is {self.parity!r}, allowed are {', '.join(get_args(Parity))}"
            )

    def __str__(self) -> str:
        return self.device

    @property
    def character_s(self) -> float:
        """Time that one character takes on the line."""
        n_bits = _BITS_AROUND_A_CHARACTER + (self.parity != "none") + self.stop_bits
        return n_bits / self.baudrate

    @property
    def frame_gap_s(self) -> float:
        """Silence that has to go before every request."""
        return max(_FRAME_GAP_CHARACTERS * self.character_s, _SHORTEST_FRAME_GAP_S)


Transport: TypeAlias = TcpTransport | SerialTransport


class ConnectionUse(StrEnum):
    """For how long a TCP connection is kept."""

    KEPT = "kept"
    PER_REPLY = "per_reply"


class RequestsInFlight:
    """How many requests a device is sent before it has answered the first.

    Attributes
    ----------
    now
        As wanted; one from the first time on that it did not answer all in order, or hung up twice
        running.
    """

    def __init__(self, wanted: int) -> None:
        self.now = wanted
        self._n_cut = 0

    def answered(self) -> None:
        """Note that all were."""
        self._n_cut = 0

    def cut(self) -> None:
        """Note that the connection was closed while some were in flight: by the device or not."""
        self._n_cut += 1
        if self._n_cut > 1:
            self.stalled()

    def stalled(self) -> None:
        """Note that the device cannot take more than one."""
        self.now = 1


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """How to reach a Modbus device, and how it wants to be asked.

    Parameters
    ----------
    device_id
        Unit id: 1 to 255 over TCP, 1 to 247 on a serial line.
    timeout_s
        For connecting and for each reply, above 0. On a serial line it must be longer than the
        slowest reply: it is also the silence that is awaited when the line is opened.
    max_registers
        Most registers in one read, 1 to 125.
    identity
        What the device must answer before anything else is read from it.
    connection
        "kept" for as long as it works, or a new one for each request: for devices that close it
        after each reply or when they are not asked for a while, or that have a single one for all.
    requests_in_flight
        Most requests that are sent at once, 1 to 16; over TCP, on a connection that is kept. Most
        devices answer them one after another and save the round trips; some lose all but one.

    Attributes
    ----------
    in_flight
        How many there may be now; remembered from one connection to the next.
    """

    transport: Transport
    device_id: int = 1
    timeout_s: float = 1.0
    max_registers: int = MAX_REGISTERS_PER_READ
    identity: Identity | None = None
    connection: ConnectionUse = ConnectionUse.KEPT
    requests_in_flight: int = 1
    in_flight: RequestsInFlight = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        serial = isinstance(self.transport, SerialTransport)
        if serial and self.connection is not ConnectionUse.KEPT:
            raise ConfigError("modbus: a serial line is kept, there are no connections on it")
        _require("device_id", self.device_id, 1, _MAX_SERIAL_DEVICE_ID if serial else 255)
        _require("max_registers", self.max_registers, 1, MAX_REGISTERS_PER_READ)
        is_single = serial or self.connection is not ConnectionUse.KEPT
        most = 1 if is_single else _MAX_REQUESTS_IN_FLIGHT
        _require("requests_in_flight", self.requests_in_flight, 1, most)
        object.__setattr__(self, "in_flight", RequestsInFlight(self.requests_in_flight))
        if not 0 < self.timeout_s < float("inf"):
            raise ConfigError(f"modbus: timeout_s is {self.timeout_s}, must be above 0")


def _require(name: str, value: int, lowest: int, highest: int) -> None:
    if not lowest <= value <= highest:
        raise ConfigError(f"modbus: {name} is {value}, allowed is {lowest} to {highest}")
