"""How a device is known to be the configured one: by registers, or by function 43/14."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TypeAlias

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


@dataclass(frozen=True, kw_only=True)
class ExpectedIdentification:
    """Answers of function 43/14; None where any answer is right."""

    vendor: str | None = None
    product_code: str | None = None
    revision: str | None = None

    def misfit(self, found: Identification) -> str | None:
        """What differs from a device's answer, in words; None if nothing does."""
        for field in fields(self):
            expected, value = getattr(self, field.name), getattr(found, field.name)
            if expected not in (None, value):
                return f"its {field.name} is {value!r}, expected is {expected!r}"
        return None


@dataclass(frozen=True, kw_only=True)
class ExpectedRegisters:
    """Registers that never change in this device and differ in others: type, firmware, serial.

    Parameters
    ----------
    address
        Of the first one, counted from 0.
    words
        What they contain, 1 to 125 words.
    function
        3 or 4.
    """

    address: int
    words: tuple[int, ...]
    function: int = READ_HOLDING_REGISTERS

    def misfit(self, content: bytes) -> str | None:
        """What differs from a device's registers, in words; None if nothing does."""
        expected = b"".join(word.to_bytes(2, "big") for word in self.words)
        if content == expected:
            return None
        found, wanted = (_hex(data) for data in (content, expected))
        return f"its registers at {self.address} are {found}, expected are {wanted}"


Identity: TypeAlias = ExpectedRegisters | ExpectedIdentification


def _hex(content: bytes) -> str:
    return " ".join(f"0x{content[at : at + 2].hex()}" for at in range(0, len(content), 2))
