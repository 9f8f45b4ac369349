"""A unit of two channels, blocks whose samples are their own numbers, and a recording of them."""

import gc
import json
import math
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from acquisition.delivery.raw import RawBlock
from acquisition.recordings import reading
from acquisition.recordings.child import answer
from acquisition.recordings.confined import printable
from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from core.machine.unit import Measurand

MADE_BY = "padwatch in a test"
START_NS = 1_767_225_600_000_000_000


@pytest.fixture(scope="session")
def unit() -> RecordedUnit:
    """Probes of -8 V at 2 mm, and slow channels in degC from -10 to 120."""
    return RecordedUnit(
        unit="U1",
        rate_hz=600.0,
        channels=tuple(
            RecordedChannel(
                id=f"c{n}",
                measurand=Measurand.GAP_UM,
                full_scale_v=12.0,
                unit_per_v=-250.0,
                ok_min_v=-11.0,
                ok_max_v=11.0,
            )
            for n in range(2)
        ),
        slow_channels=tuple(
            RecordedSlowChannel(id=f"slow{n}", unit="degC", minimum=-10.0, maximum=120.0)
            for n in range(2)
        ),
    )


def numbered_block(first_index: int, n_samples: int, epoch: int = 1, **changes: object) -> RawBlock:
    index = np.arange(first_index, first_index + n_samples)
    values: dict[str, object] = {
        "epoch": epoch,
        "first_index": first_index,
        "start_ns": START_NS + first_index * 10**7 // 6 // 1000 * 1000,
        "rate_hz": 600.0,
        "counts": (np.array([index, index + 1]) % 2**14).astype(np.int16),
        "ok": (True, True),
        "slow": (45.0, math.nan),
    }
    return RawBlock(**(values | changes))


@pytest.fixture(scope="session")
def numbered() -> Callable[..., RawBlock]:
    """Builds blocks; keywords replace fields."""
    return numbered_block


@pytest.fixture
def record(tmp_path: Path, unit: RecordedUnit) -> Callable[..., Path]:
    """Records blocks of a unit, of `unit` if none is given; gives the folder."""

    def recorded(blocks: Iterable[RawBlock], of: RecordedUnit = unit) -> Path:
        folder = tmp_path / "recording"
        with RecordingWriter(folder, of, MADE_BY) as writer:
            for block in blocks:
                writer.write(block)
        return folder

    return recorded


class _ReadingHere:
    """Stands in for the confined process, and for its pipes: reads as soon as it is asked."""

    def __init__(self) -> None:
        self.input, self.output = self, tempfile.TemporaryFile()  # noqa: SIM115
        self.close = self.output.close
        self._request, self._last_words = b"", ""

    def write(self, request: bytes) -> None:
        self._request += request

    def flush(self) -> None:
        gc.freeze()  # only what the reader leaves behind is collected below
        try:
            with _without_warnings():
                self._answer()
                gc.collect()
        finally:
            gc.unfreeze()
        self.output.seek(0)

    def _answer(self) -> None:
        try:
            answer(json.loads(self._request), self.output)
        except Exception as error:  # as the end of a process
            self._last_words = traceback.format_exception_only(error)[-1].strip()

    def last_words(self) -> str:
        return printable(self._last_words)

    def exit_code(self) -> int:
        return 1


@contextmanager
def _without_warnings() -> Iterator[None]:
    """A process that has read its file ends without closing it, and without a test to fail."""
    with warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        warnings.simplefilter("ignore")
        patch.setattr(sys, "unraisablehook", lambda _: None)
        yield


@pytest.fixture
def reads_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read within the process of the test, where it can change the reader."""
    monkeypatch.setattr(reading, "_idle_or_new", _ReadingHere)
    monkeypatch.setattr(reading, "_MAX_IDLE", 0)
