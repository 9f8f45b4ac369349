"""A bundle as one ZIP file, made while it is sent, so that it takes neither memory nor disk."""

import zipfile
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack
from io import BytesIO, RawIOBase
from pathlib import Path
from typing import BinaryIO

from service.reports.archive import EvidenceArchive, Occurrence, capture_folder
from service.reports.capture_link import linked
from service.runtime.whole_files import CHUNK

STORED = (".parquet",)
"""Kinds of files that are compressed already."""

README = """Evidence of an alarm, made by padwatch.

report.html             one page to read or print
evidence.json           all of it; its keys are described in docs/how-to/evidence.md of padwatch
spectra.parquet         cross-spectra of all bearings of the unit
orbits.parquet          the newest turns of the shaft
trend.parquet           readings of the film before the alarm
configuration.json      settings of the plant, without secrets; not for a key of some units
capture.json            which recording holds the samples around the alarm
samples/                that recording: padwatch recording info|verify|export reads it
"""


def bundle_files(
    archive: EvidenceArchive, found: Occurrence, page: str, has_configuration: bool
) -> Mapping[str, Path | bytes]:
    """The files of a bundle by their names in it.

    Parameters
    ----------
    has_configuration
        Whether the settings of the whole plant are among them.

    Raises
    ------
    DamagedEvidenceError, LookupError
        If it cannot be read, or is not there.
    """
    if found.place is None:
        raise LookupError("there is no bundle")
    files: dict[str, Path | bytes] = {"README.txt": README.encode(), "report.html": page.encode()}
    files |= {path.name: path for path in sorted(found.place.folder.iterdir())}
    if has_configuration:
        configuration = archive.configuration(archive.document(found.place).configuration)
        if configuration is not None:
            files["configuration.json"] = configuration
    capture = linked(found.place.folder)
    samples = None if capture is None else capture_folder(found.place, capture)
    if samples is not None:
        files |= {f"samples/{path.name}": path for path in sorted(samples.iterdir())}
    return files


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
