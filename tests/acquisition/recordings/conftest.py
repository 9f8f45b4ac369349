"""A unit of two channels, blocks whose samples are their own numbers, and a recording of them."""

import io
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import cell_block

from acquisition.errors import ConfigError
from acquisition.recordings import reader
from acquisition.recordings.child import answer
from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recordings.messages import Message, receive, send
from acquisition.recordings.writer import RecordingWriter
from core.machine.channel import Measurand
from core.samples.blocks import SampleBlock

MADE_BY = "padwatch in a test"
START_NS = 1_767_225_600_000_000_000


UNIT = RecordedUnit(
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
"""Probes of -8 V at 2 mm, and slow channels in degC from -10 to 120."""


@pytest.fixture(scope="session")
def unit() -> RecordedUnit:
    return UNIT


def numbered_block(
    first_index: int, n_samples: int, epoch: int = 1, **changes: object
) -> SampleBlock:
    index = np.arange(first_index, first_index + n_samples)
    values: dict[str, object] = {
        "epoch": epoch,
        "first_index": first_index,
        "start_ns": START_NS + first_index * 10**7 // 6 // 1000 * 1000,
        "rate_hz": 600.0,
        "counts": (np.array([index, index + 1]) % 2**14).astype(np.int16),
        "ok": (True, True),
        "slow": (45.0, math.nan),
        "calibration": UNIT.calibration,
    }
    return cell_block(**(values | changes))


@pytest.fixture(scope="session")
def numbered() -> Callable[..., SampleBlock]:
    """Builds blocks; keywords replace fields."""
    return numbered_block


@pytest.fixture
def record(tmp_path: Path, unit: RecordedUnit) -> Callable[..., Path]:
    """Records blocks of a unit, of `unit` if none is given; gives the folder."""

    def recorded(blocks: Iterable[SampleBlock], of: RecordedUnit = unit) -> Path:
        folder = tmp_path / "recording"
        with RecordingWriter(folder, of, MADE_BY) as writer:
            for block in blocks:
                writer.write(replace(block, calibration=of.calibration))
        return folder

    return recorded


@pytest.fixture
def reads_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read recordings within the process of the test, where it can change the reader."""

    def messages(path: Path, format_: str, _: str, request: dict[str, object]) -> Iterator[Message]:
        out = io.BytesIO()
        answer({"path": str(path), "format": format_} | request, out)
        send(out, {"kind": "end"})
        out.seek(0)
        while (message := receive(out))[0]["kind"] == "blocks":
            yield message
        if message[0]["kind"] == "error":
            raise ConfigError(message[0]["message"])

    monkeypatch.setattr(reader, "confined_messages", messages)
