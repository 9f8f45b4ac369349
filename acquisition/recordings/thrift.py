"""Thrift's compact protocol, read strictly: what a Parquet file says of itself.

Source: thrift-compact-protocol.md of Apache Thrift. Stricter than any library: a field there
twice, a list longer than the bytes that are left, or deep nesting is refused.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

TRUE, FALSE, I8, I16, I32, I64, DOUBLE, BINARY, LIST, SET, MAP, STRUCT = range(1, 13)

_MAX_DEPTH = 12
_MAX_VARINT_BYTES = 10


class ThriftError(ValueError):
    """Bytes that are no compact Thrift; the message says what is wrong with them."""


@dataclass(frozen=True)
class Field:
    """A value with the type that it has on the wire."""

    type: int
    value: Any


Struct: TypeAlias = dict[int, Field]
"""Fields by their number."""


class ThriftReader:
    """Reads values from bytes; `position` is behind the last one.

    Methods raise :class:`ThriftError`.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.position = 0

    def struct(self, depth: int = 0) -> Struct:
        """Read the fields of a struct up to its end."""
        if depth > _MAX_DEPTH:
            raise ThriftError(f"nested deeper than {_MAX_DEPTH}")
        fields: Struct = {}
        number = 0
        while head := self._byte():
            delta, type_ = head >> 4, head & 0x0F
            number = number + delta if delta else self._integer()
            if number in fields:
                raise ThriftError(f"field {number} is there twice")
            fields[number] = Field(type_, self._value(type_, depth))
        return fields

    def _value(self, type_: int, depth: int) -> Any:
        if type_ in (TRUE, FALSE):
            return type_ == TRUE
        if type_ in (I16, I32, I64):
            return self._integer()
        if type_ in (LIST, SET):
            return self._list(depth)
        if type_ == STRUCT:
            return self.struct(depth + 1)
        if type_ == BINARY:
            return self._bytes(self._varint())
        if type_ in (I8, DOUBLE):
            return self._bytes(1 if type_ == I8 else 8)
        raise ThriftError(f"a value of type {type_}")

    def _list(self, depth: int) -> list[Field]:
        head = self._byte()
        size, type_ = head >> 4, head & 0x0F
        if size == 15:
            size = self._varint()
        if size > len(self._data) - self.position:  # an element takes at least a byte
            raise ThriftError(f"a list of {size} elements in {len(self._data)} bytes")
        if type_ in (TRUE, FALSE):
            return [Field(type_, self._byte() == TRUE) for _ in range(size)]
        return [Field(type_, self._value(type_, depth + 1)) for _ in range(size)]

    def _integer(self) -> int:
        zigzag = self._varint()
        return (zigzag >> 1) ^ -(zigzag & 1)

    def _varint(self) -> int:
        value = 0
        for n in range(_MAX_VARINT_BYTES):
            byte = self._byte()
            value |= (byte & 0x7F) << 7 * n
            if byte < 0x80:
                return value
        raise ThriftError(f"a number of more than {_MAX_VARINT_BYTES} bytes")

    def _byte(self) -> int:
        if self.position >= len(self._data):
            raise ThriftError(f"cut off after {len(self._data)} bytes")
        self.position += 1
        return self._data[self.position - 1]

    def _bytes(self, size: int) -> bytes:
        if size > len(self._data) - self.position:
            raise ThriftError(f"{size} bytes announced, {len(self._data) - self.position} there")
        self.position += size
        return self._data[self.position - size : self.position]
