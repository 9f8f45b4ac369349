"""BLF logs: python-can reads their frames, and it is looked after that none of them is missing.

python-can takes a log that was cut off, or packed in a way it does not know, for one that ends
there, and an object of no length for one that never ends. So the objects are walked through, always
a container ahead. Source of the layout: python-can's ``can.io.blf``.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

from acquisition.errors import ConfigError
from acquisition.recordings.imports.extras import library

_FILE = struct.Struct("<4sL8xQQL")
"""Magic, length of the header; bytes of the file, unpacked bytes, objects."""

_OBJECT = struct.Struct("<4sHHLL")
"""Magic, length of the header, its version; length of the object, kind."""

_CONTAINER = struct.Struct("<H6xL4x")
"""How it is packed; unpacked bytes."""

_CONTAINER_KIND = 10
_FRAME_KINDS = (1, 73, 86, 100, 101)
_PLAIN, _ZLIB = 0, 2
_MAX_CONTAINER_BYTES = 2**26
_PADDING = 8
"""Before an object there are less bytes than this."""


def frames_of_blf(stream: BinaryIO) -> Iterator[Any]:
    """All frames of a log, error frames included, as python-can has them.

    Raises
    ------
    ConfigError
        If anything of it is missing, or not read by python-can.
    """
    walk = _Walk(stream.fileno())
    reader = iter(library("can.io", "a BLF log").BLFReader(stream))
    n_read = 0
    while True:
        walk.go_to(n_read + 1)
        frame = next(reader, None)
        if frame is None or n_read == walk.n_frames:
            break
        n_read += 1
        yield frame
    if frame is not None or n_read != walk.n_frames:
        raise ConfigError(f"has {walk.n_frames} frames, of which {n_read} can be read")


class _Walk:
    """The objects of a log, always further on than python-can: it believes what they say.

    Attributes
    ----------
    n_frames
        Passed so far.
    """

    def __init__(self, file: int) -> None:
        self._file, self._size = file, os.fstat(file).st_size
        self._tail = b""
        self._n_objects = self.n_frames = 0
        magic, n_header, n_bytes, _, self._n_declared = _FILE.unpack(self._read(0, _FILE.size))
        if magic != b"LOGG":
            raise ConfigError("not a BLF log")
        if n_bytes != self._size:
            raise ConfigError(
                f"the file has {self._size} bytes, its header says {n_bytes}: cut off, or whatever"
                " wrote it has not finished it"
            )
        self._at = max(n_header, _FILE.size)

    def go_to(self, n_frames: int) -> None:
        """Go on until so many frames are passed, or to the end."""
        while self.n_frames < n_frames and self._at < self._size:
            self._at = self._past_container(self._at)
            if self._at >= self._size:
                self._require_all()

    def _require_all(self) -> None:
        if self._tail:
            raise ConfigError("cut off: it ends within an object")
        if self._n_objects < self._n_declared:
            raise ConfigError(f"{self._n_objects} objects, the header says {self._n_declared}")

    def _past_container(self, at: int) -> int:
        kind, n_bytes = _head(self._read(at, _OBJECT.size))
        content = self._read(at + _OBJECT.size, n_bytes - _OBJECT.size)
        if kind == _CONTAINER_KIND:
            self._count_in(self._tail + _unpacked(content, at))
        elif kind in _FRAME_KINDS:
            raise ConfigError(f"a frame outside of any container at {at}; such logs are not read")
        return at + n_bytes + n_bytes % 4  # so much padding is what the format has

    def _count_in(self, content: bytes) -> None:
        at = 0
        while (found := content.find(b"LOBJ", at, at + _PADDING)) >= 0:
            if len(content) < found + _OBJECT.size:
                break
            kind, n_bytes = _head(content[found : found + _OBJECT.size])
            if found + n_bytes > len(content):
                break
            self._n_objects += 1
            self.n_frames += kind in _FRAME_KINDS
            at = found + n_bytes
        self._tail = content[at:]
        if found < 0 and len(self._tail) >= _PADDING:
            raise ConfigError("damaged: there is no object where one should be")
        if len(self._tail) > _MAX_CONTAINER_BYTES:
            raise ConfigError(f"an object of more than {_MAX_CONTAINER_BYTES} bytes")
        if not self._tail.strip(b"\0"):
            self._tail = b""

    def _read(self, at: int, n_bytes: int) -> bytes:
        if at + n_bytes > self._size:
            raise ConfigError(f"cut off: {n_bytes} bytes are needed at {at} of {self._size}")
        return os.pread(self._file, n_bytes, at)


def _head(content: bytes) -> tuple[int, int]:
    """Kind and length of an object."""
    magic, n_header, _, n_bytes, kind = _OBJECT.unpack(content)
    if magic != b"LOBJ" or not _OBJECT.size <= n_header <= n_bytes:
        raise ConfigError("damaged: an object that is none")
    return kind, n_bytes


def _unpacked(packed: bytes, at: int) -> bytes:
    if len(packed) < _CONTAINER.size:
        raise ConfigError(f"a container of {len(packed)} bytes at {at}")
    method, n_bytes = _CONTAINER.unpack_from(packed)
    content = packed[_CONTAINER.size :]
    if method not in (_PLAIN, _ZLIB) or n_bytes > _MAX_CONTAINER_BYTES:
        raise ConfigError(f"a container at {at}, packed by method {method} from {n_bytes} bytes")
    if method == _PLAIN:
        return content
    unpacker = zlib.decompressobj()
    try:
        found = unpacker.decompress(content, n_bytes + 1)
    except zlib.error as error:
        raise ConfigError(f"damaged: a container at {at}: {error}") from error
    if len(found) != n_bytes or not unpacker.eof:
        raise ConfigError(f"damaged: a container at {at} is not of {n_bytes} bytes unpacked")
    return found
