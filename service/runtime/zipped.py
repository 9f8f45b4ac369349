"""A ZIP file made piece by piece, while it is sent."""

import zipfile
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack
from io import BytesIO, RawIOBase
from pathlib import Path
from typing import BinaryIO

from service.runtime.whole_files import CHUNK

STORED = (".parquet",)
"""Kinds of files that are compressed already."""


def zipped(files: Mapping[str, Path | bytes]) -> Generator[bytes, None, None]:
    """The ZIP file, piece by piece, none of them empty.

    All files are opened first: what is removed meanwhile is still sent whole.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    sink = Sink()
    with ExitStack() as opened:
        streams = {name: opened.enter_context(_open(each)) for name, each in files.items()}
        with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, stream in streams.items():
                how = zipfile.ZIP_STORED if name.endswith(STORED) else zipfile.ZIP_DEFLATED
                info = zipfile.ZipInfo(name)
                info.compress_type = how
                with archive.open(info, "w", force_zip64=True) as entry:
                    while chunk := stream.read(CHUNK):
                        entry.write(chunk)
                        yield from sink.taken()
        yield from sink.taken()


def _open(each: Path | bytes) -> BinaryIO:
    return BytesIO(each) if isinstance(each, bytes) else each.open("rb")


class Sink(RawIOBase):
    """Collects what a file is made of; it is never sought in."""

    def __init__(self) -> None:
        super().__init__()
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """Whether it can be written to: yes."""
        return True

    def write(self, piece: object) -> int:
        """Take a piece."""
        content = bytes(piece)  # type: ignore[call-overload]
        self._pieces.append(content)
        return len(content)

    def taken(self) -> Iterator[bytes]:
        """What has been collected since the last time."""
        content = b"".join(self._pieces)
        self._pieces.clear()
        if content:
            yield content
