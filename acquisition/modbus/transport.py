"""Settings of a link: a TCP address or a serial line, and how the device wants to be asked.

The plant file's settings refuse values out of their limits; nothing is checked here again.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from acquisition.errors import ConfigError
from acquisition.modbus.identity import Identity

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

    Raises
    ------
    ConfigError
        If the port is 0, which only a simulated device may have in a plant file.
    """

    host: str
    port: int = 502

    def __post_init__(self) -> None:
        if self.port == 0:
            raise ConfigError("modbus: port is 0, allowed is 1 to 65535")

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
        Bits per second.
    """

    device: str
    baudrate: int = 19_200
    parity: Literal["none", "even", "odd"] = "even"
    stop_bits: Literal[1, 2] = 1

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
    identity
        What the device must answer before anything else is read from it.
    keeps_connection
        Whether a connection is kept for as long as it works. False is for TCP devices that close it
        after each reply or when they are not asked for a while, or that have a single one for all.
    requests_in_flight
        Most requests that are sent at once, 1 to 16; over TCP, on a connection that is kept. Most
        devices answer them one after another and save the round trips; some lose all but one.
    """

    transport: Transport
    device_id: int = 1
    timeout_s: float = 1.0
    identity: Identity | None = None
    keeps_connection: bool = True
    requests_in_flight: int = 1
