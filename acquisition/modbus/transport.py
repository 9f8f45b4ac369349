"""Settings of a link: a TCP address or a serial line, and how the device wants to be asked."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, TypeAlias, get_args

from acquisition.errors import ConfigError
from acquisition.modbus.identity import Identity
from acquisition.modbus.requests import MAX_REGISTERS_PER_READ

Parity: TypeAlias = Literal["none", "even", "odd"]

_MAX_REQUESTS_IN_FLIGHT = 16
_MIN_BAUDRATE, _MAX_BAUDRATE = 300, 4_000_000
_MAX_TCP_DEVICE_ID, _MAX_SERIAL_DEVICE_ID = 255, 247
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
        Name or address; example: "192.0.2.17".
    port
        1 to 65535.
    """

    host: str
    port: int = 502

    def __post_init__(self) -> None:
        require_between(self, "port", 1, 65535)

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
        require_between(self, "baudrate", _MIN_BAUDRATE, _MAX_BAUDRATE)
        require_between(self, "stop_bits", 1, 2)
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

    Raises
    ------
    ConfigError
        With the value that cannot be, and what is allowed.
    """

    transport: Transport
    device_id: int = 1
    timeout_s: float = 1.0
    max_registers: int = MAX_REGISTERS_PER_READ
    identity: Identity | None = None
    connection: ConnectionUse = ConnectionUse.KEPT
    requests_in_flight: int = 1

    def __post_init__(self) -> None:
        is_serial = isinstance(self.transport, SerialTransport)
        is_kept = self.connection is ConnectionUse.KEPT
        if is_serial and not is_kept:
            raise ConfigError("modbus: a serial line is kept, there are no connections on it")
        require_between(
            self, "device_id", 1, _MAX_SERIAL_DEVICE_ID if is_serial else _MAX_TCP_DEVICE_ID
        )
        require_between(self, "max_registers", 1, MAX_REGISTERS_PER_READ)
        is_single = is_serial or not is_kept
        require_between(self, "requests_in_flight", 1, 1 if is_single else _MAX_REQUESTS_IN_FLIGHT)
        require_above_zero(self, "timeout_s")


def require_between(settings: object, name: str, lowest: int, highest: int) -> None:
    """Refuse a setting outside its limits.

    Raises
    ------
    ConfigError
        With its name, its value and what is allowed.
    """
    value = getattr(settings, name)
    if not lowest <= value <= highest:
        raise ConfigError(f"modbus: {name} is {value}, allowed is {lowest} to {highest}")


def require_above_zero(settings: object, *names: str) -> None:
    """Refuse times that are not finite and above zero.

    Raises
    ------
    ConfigError
        With the name and value of the first such.
    """
    for name in names:
        value = getattr(settings, name)
        if not 0.0 < value < float("inf"):
            raise ConfigError(f"modbus: {name} is {value}, must be above 0")
