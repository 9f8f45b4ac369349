"""Child process that reads a file of readings and writes its rows as an Arrow stream.

Its memory and time are limited and it cannot write files, so that a hostile file harms only this
process.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa

from acquisition.recordings.confined import confine
from service.cli.offline.backtest_cells import MAX_ROWS, ReadingsError
from service.cli.offline.backtest_tables import MAGIC, csv_batches, parquet_batches

MEMORY_BYTES = 3 * 2**30
CPU_S = 3600
WRONG_FILE = 3
"""Exit code of a wrong file; standard error holds a message for the user."""

_LOG_BYTES = 100_000


def main() -> None:
    """Read the file named by the first argument."""
    confine(MEMORY_BYTES, CPU_S, _LOG_BYTES)
    try:
        with Path(sys.argv[1]).open("rb") as stream:
            _send(_batches(stream), sys.stdout.buffer)
    except (ReadingsError, OSError) as error:
        words = error.strerror if isinstance(error, OSError) else str(error)
        _end(words or str(error))
    except MemoryError:  # pyarrow's error is a subclass
        _end(f"needs more than {MEMORY_BYTES >> 30} GiB to read")


def _batches(stream: BinaryIO) -> Iterator[tuple[Any, int]]:
    is_parquet = stream.read(len(MAGIC)) == MAGIC
    stream.seek(0)
    return parquet_batches(stream) if is_parquet else csv_batches(stream)


def _send(batches: Iterator[tuple[Any, int]], out: BinaryIO) -> None:
    n_rows, writer = 0, None
    for batch, n_bytes in batches:
        n_rows += len(batch)
        if n_rows > MAX_ROWS:
            raise ReadingsError(f"more than {MAX_ROWS} rows")
        writer = writer or pa.ipc.new_stream(out, batch.schema)
        writer.write_batch(batch, custom_metadata={"n_bytes": str(n_bytes)})
    if writer is None:
        raise ReadingsError("has no rows")
    writer.close()


def _end(words: str) -> None:
    sys.stderr.write(words[:2000])
    sys.exit(WRONG_FILE)


if __name__ == "__main__":
    main()
