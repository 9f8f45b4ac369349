"""No exception of pyarrow or the disk leaves under its own name."""

import inspect
from collections.abc import Callable

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from acquisition.errors import ConfigError
from acquisition.recording.reader import open_recording
from acquisition.recording.source import RecordingSource

FOREIGN = [
    kind
    for _, kind in inspect.getmembers(pa.lib, inspect.isclass)
    if issubclass(kind, pa.ArrowException | OSError)
] + [OSError, PermissionError, TimeoutError]


@pytest.mark.parametrize("call", ["__init__", "read_row_group"])
@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_reading_a_recording_raises_is_renamed(
    kind: type[Exception],
    call: str,
    record: Callable,
    numbered: Callable,
    stepped_clock,
    monkeypatch,
) -> None:
    folder = record([numbered(50 * n, 50) for n in range(5)])
    source = RecordingSource(open_recording(folder), stepped_clock)

    def fails(*_: object, **__: object) -> None:
        raise kind("as seen in the field")

    async def read() -> None:
        async with source.connect() as blocks:
            await anext(blocks)

    monkeypatch.setattr(pq.ParquetFile, call, fails)
    with pytest.raises(ConfigError, match=r"\.parquet: .*as seen in the field"):
        await read()
