"""`Cell`: address, type and byte order of one number in a device."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

BITS_PER_REGISTER = 16


class NumberType(StrEnum):
    """Type of a number."""

    INT16 = "int16"
    UINT16 = "uint16"
    INT32 = "int32"
    UINT32 = "uint32"
    FLOAT32 = "float32"
    FLOAT64 = "float64"
    BIT = "bit"


DTYPES = {
    NumberType.INT16: ">i2",
    NumberType.UINT16: ">u2",
    NumberType.INT32: ">i4",
    NumberType.UINT32: ">u4",
    NumberType.FLOAT32: ">f4",
    NumberType.FLOAT64: ">f8",
    NumberType.BIT: ">u2",
}
"""As numpy reads them once their bytes are in the order ABCD."""

N_BYTES = {type_: int(name[-1]) for type_, name in DTYPES.items()}
FLOATS = (NumberType.FLOAT32, NumberType.FLOAT64)
INTEGERS = (NumberType.INT16, NumberType.UINT16, NumberType.INT32, NumberType.UINT32)


def reads_as(found: float, type_: NumberType, number: float) -> bool:
    """Whether a number that was read is the one in a manual.

    Integers are compared by their bits, so that 0x8000 is -32768; a number in the manual is
    rounded to float32 before it is compared with one.
    """
    if type_ in INTEGERS:
        return number % 1 == 0 and (int(found) - int(number)) % (1 << 8 * N_BYTES[type_]) == 0
    if type_ is NumberType.FLOAT32:
        with np.errstate(over="ignore"):
            return found == float(np.float32(number))
    return found == number


class ByteOrder(StrEnum):
    """Order in which four bytes come; A is the most significant.

    The order of the words and the order of the bytes in each word may each be reversed. A single
    register has only the second; of four registers all words are reversed.
    """

    ABCD = "ABCD"
    CDAB = "CDAB"
    BADC = "BADC"
    DCBA = "DCBA"

    @property
    def low_word_first(self) -> bool:
        """Whether the first register is the least significant."""
        return self in (ByteOrder.CDAB, ByteOrder.DCBA)

    @property
    def low_byte_first(self) -> bool:
        """Whether the first byte of a register is the least significant."""
        return self in (ByteOrder.BADC, ByteOrder.DCBA)

    @property
    def pair(self) -> str:
        """Byte order of a single register: "AB" or "BA"."""
        return "BA" if self.low_byte_first else "AB"


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One number in a device.

    Parameters
    ----------
    address
        As the manual writes it.
    function
        1 (coils) or 2 (discrete inputs) for single bits, 3 (holding) or 4 (input registers).
    bit
        Of a register, 0 the least significant; for type "bit" read by function 3 or 4.
    """

    address: int
    function: int = 3
    type: NumberType = NumberType.UINT16
    byte_order: ByteOrder = ByteOrder.ABCD
    bit: int | None = None

    @property
    def n_places(self) -> int:
        """Addresses that it takes: registers, or one bit of functions 1 and 2."""
        return N_BYTES[self.type] // 2

    def start(self, base: int) -> int:
        """Address on the wire, counted from 0."""
        return self.address - base

    def stop(self, base: int) -> int:
        """First address on the wire after it."""
        return self.start(base) + self.n_places
