"""`Cell`: address, type and byte order of one number in the registers of a Modbus device."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

BITS_PER_REGISTER = 16


class NumberType(StrEnum):
    """Data type of a number in registers."""

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
"""numpy dtype of each number type, for bytes in the order ABCD (big-endian)."""

N_BYTES = {type_: int(name[-1]) for type_, name in DTYPES.items()}
FLOATS = (NumberType.FLOAT32, NumberType.FLOAT64)
INTEGERS = (NumberType.INT16, NumberType.UINT16, NumberType.INT32, NumberType.UINT32)


def reads_as(found: float, type_: NumberType, number: float) -> bool:
    """Return whether a number read from the device equals a number from its manual.

    Integers are compared by their bits: 0x8000 equals -32768. For float32, the number from the
    manual is rounded to float32 before the comparison.
    """
    if type_ in INTEGERS:
        return number % 1 == 0 and (int(found) - int(number)) % (1 << 8 * N_BYTES[type_]) == 0
    if type_ is NumberType.FLOAT32:
        with np.errstate(over="ignore"):
            return found == float(np.float32(number))
    return found == number


class ByteOrder(StrEnum):
    """Byte order of a four-byte number in two registers; A is the most significant byte.

    The order of the words and the order of the bytes in each word can be reversed independently.
    In a single register, only the order of the bytes applies. In a float64, the order of all four
    words is reversed.
    """

    ABCD = "ABCD"
    CDAB = "CDAB"
    BADC = "BADC"
    DCBA = "DCBA"

    @property
    def low_word_first(self) -> bool:
        """Whether the first register holds the least significant word."""
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
    """Location and type of one number in the registers, coils or inputs of a device.

    Parameters
    ----------
    address
        Address as printed in the manual; the first address there is `RegisterMap.base`.
    function
        1 (coils) or 2 (discrete inputs) for single bits, 3 (holding) or 4 (input registers).
    bit
        Bit number in a register, 0 = least significant; for type "bit" read by function 3 or 4.
    """

    address: int
    function: int = 3
    type: NumberType = NumberType.UINT16
    byte_order: ByteOrder = ByteOrder.ABCD
    bit: int | None = None

    @property
    def n_places(self) -> int:
        """Number of addresses that the cell occupies: registers, or 1 for functions 1 and 2."""
        return N_BYTES[self.type] // 2

    def start(self, base: int) -> int:
        """Return the first address of the cell on the wire, where the manual's `base` is 0."""
        return self.address - base

    def stop(self, base: int) -> int:
        """Return the address after the cell on the wire, where the manual's `base` is 0."""
        return self.start(base) + self.n_places
