"""The reading process: ``python -m acquisition.recordings.child FILE``, the job on standard input.

Whatever a hostile file does to a reader happens here, with bounded memory and time and without
writing anything; what comes out are messages of :mod:`acquisition.recordings.stream`.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from pydantic import TypeAdapter

from acquisition.errors import ConfigError
from acquisition.recordings.confined import confine
from acquisition.recordings.imports.job import Format, ImportJob
from acquisition.recordings.imports.rows import Table, raw_blocks
from acquisition.recordings.stream import block_message, frames_message, send

MEMORY_BYTES = 2 * 2**30
CPU_S = 3600
_LOG_BYTES = 1_000_000


def main() -> None:
    """Read one file."""
    confine(MEMORY_BYTES, CPU_S, _LOG_BYTES)
    job = TypeAdapter(ImportJob).validate_json(sys.stdin.buffer.read())
    answer(Path(sys.argv[1]), job, sys.stdout.buffer)


def answer(path: Path, job: ImportJob, out: BinaryIO) -> None:
    """Write the messages of one file; a file that is refused ends in an error message."""
    try:
        _read(path, job, out)
    except ConfigError as error:
        send(out, {"kind": "error", "message": str(error)[:1000]})
    except MemoryError:
        send(out, {"kind": "error", "message": f"needs more than {MEMORY_BYTES >> 30} GiB to read"})
    out.flush()


def _read(path: Path, job: ImportJob, out: BinaryIO) -> None:
    if job.format in ("candump", "blf"):
        from acquisition.recordings.imports.can_log import read_frames

        send(out, {"kind": "start", "sample_type": ""})
        for batch, done in read_frames(path, job):
            send(out, *frames_message(batch, done))
    else:
        table = _TABLES[job.format](path, job)
        send(out, {"kind": "start", "sample_type": table.sample_type})
        for block, done in raw_blocks(table.rows(), job):
            send(out, *block_message(block, done))
    send(out, {"kind": "end"})


def _csv(path: Path, job: ImportJob) -> Table:
    from acquisition.recordings.imports.csv_file import CsvTable

    return CsvTable(path, job)


def _hdf5(path: Path, job: ImportJob) -> Table:
    from acquisition.recordings.imports.hdf5_file import Hdf5Table

    return Hdf5Table(path, job)


def _tdms(path: Path, job: ImportJob) -> Table:
    from acquisition.recordings.imports.tdms_file import TdmsTable

    return TdmsTable(path, job)


def _mdf4(path: Path, job: ImportJob) -> Table:
    from acquisition.recordings.imports.mdf_file import MdfTable

    return MdfTable(path, job)


_TABLES: dict[Format, Callable[[Path, ImportJob], Table]] = {
    "csv": _csv,
    "hdf5": _hdf5,
    "tdms": _tdms,
    "mdf4": _mdf4,
}

if __name__ == "__main__":
    main()
