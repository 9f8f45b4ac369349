"""Expected identity of a device: register contents, or identification by function 43/14."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TypeAlias

from acquisition.modbus.requests import READ_HOLDING_REGISTERS


@dataclass(frozen=True)
class Identification:
    """Identification read by function 43/14; a text is empty if the device does not report it."""

    vendor: str
    product_code: str
    revision: str

    @classmethod
    def of_objects(cls, objects: Mapping[int, bytes]) -> "Identification":
        """Return the identification from objects 0 to 2; bytes outside ASCII are escaped."""
        texts = (objects.get(number, b"") for number in range(3))
        return cls(*(text.decode("ascii", "backslashreplace").strip("\0 ") for text in texts))


@dataclass(frozen=True, kw_only=True)
class ExpectedIdentification:
    """Expected identification by function 43/14; a field of None matches any value."""

    vendor: str | None = None
    product_code: str | None = None
    revision: str | None = None

    def misfit(self, found: Identification) -> str | None:
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


Identity: TypeAlias = ExpectedRegisters | ExpectedIdentification


def _hex(content: bytes) -> str:
    return " ".join(f"0x{content[at : at + 2].hex()}" for at in range(0, len(content), 2))
