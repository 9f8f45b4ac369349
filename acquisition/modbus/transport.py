"""Settings of a Modbus link: address or serial line, identity of the device, timeouts.

The values are validated by the settings of the plant file, and not checked here again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Literal, TypeAlias

from acquisition.errors import ConfigError
from acquisition.modbus.requests import READ_HOLDING_REGISTERS


@dataclass(frozen=True)
class Identification:
    """Identification by function 43/14, as read or as expected.

    A text is empty if the device does not report it; an expected text of None matches any text.
    """

    vendor: str | None = None
    product_code: str | None = None
    revision: str | None = None

    @classmethod
    def of_objects(cls, objects: Mapping[int, bytes]) -> "Identification":
        """Return the identification from objects 0 to 2; bytes outside ASCII are escaped."""
        texts = (objects.get(number, b"") for number in range(3))
        return cls(*(text.decode("ascii", "backslashreplace").strip("\0 ") for text in texts))

    def misfit(self, found: "Identification") -> str | None:
        """Return a description of the first field of `found` that differs; None if all match."""
        for field in fields(self):
            expected, value = getattr(self, field.name), getattr(found, field.name)
            if expected not in (None, value):
                return f"{field.name} is {value!r}, expected {expected!r}"
        return None


@dataclass(frozen=True, kw_only=True)
class ExpectedRegisters:
    """Expected contents of registers that identify a device: type, firmware, serial number.

    Parameters
    ----------
    address
        Address of the first register, counted from 0.
    words
        Expected register contents, 1 to 125 words.
    function
        3 (holding registers) or 4 (input registers).
    """

    address: int
    words: tuple[int, ...]
    function: int = READ_HOLDING_REGISTERS

    def misfit(self, content: bytes) -> str | None:
        """Return a description of how the register contents differ; None if they are equal."""
        expected = b"".join(word.to_bytes(2, "big") for word in self.words)
        if content == expected:
            return None
        found, wanted = (_hex(data) for data in (content, expected))
        return f"registers from {self.address} are {found}, expected {wanted}"


Identity: TypeAlias = ExpectedRegisters | Identification


def _hex(content: bytes) -> str:
    return " ".join(f"0x{content[at : at + 2].hex()}" for at in range(0, len(content), 2))


_BITS_AROUND_A_CHARACTER = 9  # a start bit and eight of data
_FRAME_GAP_CHARACTERS = 3.5
_SHORTEST_FRAME_GAP_S = 0.00175
"""Minimum gap between frames, s, above 19,200 Bd (Modbus over Serial Line 1.02, 2.5.1.1)."""


@dataclass(frozen=True, kw_only=True)
class TcpTransport:
    """Address of a Modbus TCP device.

    Parameters
    ----------
    host
        Host name or IP address; example: "192.0.2.17".
    port
        TCP port, 1 to 65535.

    Raises
    ------
    ConfigError
        If the port is 0; a plant file allows port 0 for simulated devices only.
    """

    host: str
    port: int = 502

    def __post_init__(self) -> None:
        if self.port == 0:
            raise ConfigError("Modbus TCP port must be 1 to 65535, got 0")

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True, kw_only=True)
class SerialTransport:
    """Serial line with Modbus RTU; always eight data bits.

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
        """Duration of one character on the line, s."""
        n_bits = _BITS_AROUND_A_CHARACTER + (self.parity != "none") + self.stop_bits
        return n_bits / self.baudrate

    @property
    def frame_gap_s(self) -> float:
        """Silence required before each request, s."""
        return max(_FRAME_GAP_CHARACTERS * self.character_s, _SHORTEST_FRAME_GAP_S)


Transport: TypeAlias = TcpTransport | SerialTransport


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """Transport of a Modbus device, and limits of its connections and requests.

    Parameters
    ----------
    device_id
        Unit id: 1 to 255 over TCP, 1 to 247 on a serial line.
    timeout_s
        Timeout for connecting and for each reply, above 0. On a serial line it must exceed the
        slowest reply: it is also the required silence after the line is opened.
    identity
        Expected identity of the device, checked before any other read; None for no check.
    keeps_connection
        Whether the connection is kept open between requests. False is for TCP devices that close
        the connection after each reply or when idle, or that accept one connection at a time.
    requests_in_flight
        Maximum number of requests sent before the first reply, 1 to 16; above 1 for TCP with a kept
        connection only. Several requests save round trips; some devices answer only one of them.
    """

    transport: Transport
    device_id: int = 1
    timeout_s: float = 1.0
    identity: Identity | None = None
    keeps_connection: bool = True
    requests_in_flight: int = 1
