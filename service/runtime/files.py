"""Atomic file writes with sync to the disk, and streamed ZIP archives."""

import os
import tempfile
import zipfile
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack
from io import BytesIO, RawIOBase
from pathlib import Path
from typing import BinaryIO

CHUNK = 1 << 20
"""Maximum number of bytes per read from a file."""

ASIDE = ".part"
"""Suffix of the temporary name of a file that is being written."""

PRIVATE = 0o600

STORED = (".parquet",)
"""Suffixes of file formats with compression, which a ZIP archive stores uncompressed."""


def write_synced(path: Path, content: bytes) -> None:
    """Write a file, not atomically, and sync its content. Raises `OSError` if this fails."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: under a temporary name, with a sync before and after the rename.

    Only one process may write the file at a time. Raises `OSError` if the disk cannot be written.
    """
    aside = path.with_name(path.name + ASIDE)
    try:
        write_synced(aside, content)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
    sync_folder(path.parent)


def write_private(path: Path, content: bytes) -> None:
    """Write a file atomically, readable by its owner only.

    Several processes may write the same file at the same time. Raises `OSError` if the disk cannot
    be written; the previous file then stays, unless only the sync after the rename failed.
    """
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}-", dir=path.parent)
    aside = Path(name)
    try:
        os.close(descriptor)
        write_synced(aside, content)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)
    sync_folder(path.parent)


def create_private(path: Path) -> None:
    """Create an empty file that only its owner can read. Raises `FileExistsError` if it exists."""
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, PRIVATE))


def put_in_place(aside: Path, path: Path) -> None:
    """Sync a temporary file, rename it to `path`, sync the folder. Raises `OSError` on failure."""
    _sync(aside)
    aside.replace(path)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Sync the directory entries of a folder to the disk. Raises `OSError` if this fails."""
    _sync(folder)


def zipped(files: Mapping[str, Path | bytes]) -> Generator[bytes, None, None]:
    """Yield a ZIP archive in non-empty pieces; `files` maps names to paths or contents.

    All files are opened first, so a file that is removed during the iteration is still complete.
    Raises `OSError` if a file cannot be read.
    """
    sink = Sink()
    with ExitStack() as opened:
        streams = {name: opened.enter_context(_open(each)) for name, each in files.items()}
        with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, stream in streams.items():
                info = zipfile.ZipInfo(name)
                info.compress_type = (
                    zipfile.ZIP_STORED if name.endswith(STORED) else zipfile.ZIP_DEFLATED
                )
                with archive.open(info, "w", force_zip64=True) as entry:
                    while chunk := stream.read(CHUNK):
                        entry.write(chunk)
                        yield from sink.taken()
        yield from sink.taken()


class Sink(RawIOBase):
    """Write-only in-memory file; `taken` returns and removes the bytes written so far."""

    def __init__(self) -> None:
        super().__init__()
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        """Return True, since the stream accepts writes."""
        return True

    def write(self, piece: object) -> int:
        """Append the bytes `piece` to the buffer; return the number of bytes."""
        content = bytes(piece)  # type: ignore[call-overload]
        self._pieces.append(content)
        return len(content)

    def taken(self) -> Iterator[bytes]:
        """Yield the bytes written since the last call as one piece; yield no empty piece."""
        content = b"".join(self._pieces)
        self._pieces.clear()
        if content:
            yield content


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _open(each: Path | bytes) -> BinaryIO:
    return BytesIO(each) if isinstance(each, bytes) else each.open("rb")
