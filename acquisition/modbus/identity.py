"""Whether a device is the configured one: registers that it must hold, and function 43/14."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Protocol, TypeAlias

from acquisition.errors import ConfigError
from acquisition.modbus.requests import READ_HOLDING_REGISTERS


@dataclass(frozen=True)
class Identification:
    """The basic objects of function 43/14; empty where the device gives none."""

    vendor: str
    product_code: str
    revision: str

    @classmethod
    def of_objects(cls, objects: Mapping[int, bytes]) -> "Identification":
        """Build from objects 0 to 2 as they were read; what is not ASCII is shown escaped."""
        texts = (objects.get(number, b"") for number in range(3))
        return cls(*(text.decode("ascii", "backslashreplace").strip("\0 ") for text in texts))


_N_TRIES = 2
"""A reply that was changed on the way is not another device."""


@dataclass(frozen=True, kw_only=True)
class Signature:
    """Registers that never change in this device and differ in others: type, firmware, serial.

    Parameters
    ----------
    address
        Of the first one, counted from 0.
    words
        What they contain, 1 to 125.
    function
        3 or 4.
    """

    address: int
    words: tuple[int, ...]
    function: int = READ_HOLDING_REGISTERS

    def __post_init__(self) -> None:
        if not self.words or not all(0 <= word <= 0xFFFF for word in self.words):
            raise ConfigError(
                f"modbus: signature is {self.words}, needed are words of 0 to {0xFFFF}"
            )


@dataclass(frozen=True, kw_only=True)
class ExpectedIdentification:
    """Answers of function 43/14; None where any will do."""

    vendor: str | None = None
    product_code: str | None = None
    revision: str | None = None


Identity: TypeAlias = Signature | ExpectedIdentification


class IdentifiableDevice(Protocol):
    """What it takes to ask a device who it is."""

    @property
    def where(self) -> str:
        """Where the device is."""
        ...

    async def read(self, address: int, n_registers: int, function: int) -> bytes:
        """Read registers."""
        ...

    async def identify(self) -> Identification:
        """Read vendor, product code and revision."""
        ...


async def require_identity(device: IdentifiableDevice, identity: Identity) -> None:
    """Refuse a device that is another one than expected.

    Raises
    ------
    ConfigError
        Naming what was found and what was expected.
    LinkError, FrameError
        As the device does.
    """
    for _ in range(_N_TRIES):
        misfit = await _misfit(device, identity)
        if misfit is None:
            return
    raise ConfigError(f"{device.where}: another device answers: {misfit}")


async def _misfit(device: IdentifiableDevice, identity: Identity) -> str | None:
    if isinstance(identity, Signature):
        return await _other_signature(device, identity)
    found = await device.identify()
    for field in fields(identity):
        expected = getattr(identity, field.name)
        value = getattr(found, field.name)
        if expected is not None and value != expected:
            return f"its {field.name} is {value!r}, expected is {expected!r}"
    return None


async def _other_signature(device: IdentifiableDevice, signature: Signature) -> str | None:
    n_words = len(signature.words)
    data = await device.read(signature.address, n_words, signature.function)
    found = tuple(int.from_bytes(data[2 * i : 2 * i + 2], "big") for i in range(n_words))
    if found == signature.words:
        return None
    return (
        f"its registers at {signature.address} are {_hex(found)},"
        f" expected are {_hex(signature.words)}"
    )


def _hex(words: tuple[int, ...]) -> str:
    return " ".join(f"{word:#06x}" for word in words)
