"""A run of two waveform channels and a slow one, and jobs that read it back."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.recordings.imports.job import (
    ChannelColumn,
    ColumnName,
    ImportJob,
    SlowColumn,
    TimeAxis,
)
from acquisition.recordings.reading import imported_blocks
from core.samples.blocks import SampleBlock

START_NS = 1_767_225_600_000_000_000
PER_COUNT = 12.0 / 32768 * 250.0


@dataclass(frozen=True)
class Run:
    """What is in the file: a gap of 37 samples after 500, slow values once a second."""

    index: np.ndarray = field(
        default_factory=lambda: np.concatenate([np.arange(500), np.arange(537, 1300)])
    )

    @property
    def since_start_s(self) -> np.ndarray:
        """Of each sample, in whole microseconds."""
        return np.floor(self.index * (1e6 / 600.0)) / 1e6

    @property
    def counts(self) -> np.ndarray:
        return np.stack([self.index % 2**14, -self.index]).astype(np.int16)

    @property
    def units_um(self) -> np.ndarray:
        """As float32 of full resolution."""
        return (self.counts * PER_COUNT + 1 / 3).astype(np.float32)

    slow_s = np.array([0.0, 1.0, 2.0])
    slow_degc = np.array([40.5, 41.5, np.nan])


@pytest.fixture
def run() -> Run:
    return Run()


@pytest.fixture
def job() -> ImportJob:
    """Names are those of the files that the tests write; the time is elapsed seconds."""
    return ImportJob(
        format="csv",
        rate_hz=600.0,
        time=TimeAxis("column", 0, ColumnName("time"), "elapsed_s", START_NS),
        channels=(
            ChannelColumn("x", ColumnName("shaft x"), "um", 1.0, PER_COUNT),
            ChannelColumn("y", ColumnName("shaft y"), "um", 1.0, PER_COUNT),
        ),
        slow=(SlowColumn("oil", ColumnName("oil"), "degC", 1.0, time=ColumnName("oil time")),),
    )


@dataclass(frozen=True)
class Found:
    """All cells of a file."""

    sample_type: str
    blocks: list[SampleBlock]

    @property
    def index(self) -> np.ndarray:
        return np.concatenate([np.arange(b.first_index, b.stop_index) for b in self.blocks])

    @property
    def samples(self) -> np.ndarray:
        return np.concatenate([b.counts for b in self.blocks], axis=1)


@pytest.fixture
def read() -> Callable[[Path, ImportJob], Found]:
    def read_all(path: Path, job: ImportJob) -> Found:
        blocks = [cell for block, _ in imported_blocks(path, job) for cell in block.cells()]
        return Found(blocks[0].counts.dtype.name, blocks)

    return read_all


@pytest.fixture
def read_text(tmp_path, job, read) -> Callable[..., Found]:
    """Reads a text without slow values as CSV; keywords change the job."""

    def read_it(text: str, **changes: Any) -> Found:
        (tmp_path / "run.mf4").write_text(text)
        return read(tmp_path / "run.mf4", replace(job, slow=(), **changes))

    return read_it


@pytest.fixture
def placed() -> Callable[[ImportJob, str], ImportJob]:
    """The same job with waveforms and slow values in groups."""

    def in_groups(job: ImportJob, waveforms: str = "waveforms", slow: str = "slow") -> ImportJob:
        return replace(
            job,
            time=replace(job.time, place=ColumnName("time", waveforms)),
            channels=tuple(
                replace(c, place=ColumnName(c.place.name, waveforms)) for c in job.channels
            ),
            slow=tuple(
                replace(c, place=ColumnName(c.place.name, slow), time=ColumnName("oil time", slow))
                for c in job.slow
            ),
        )

    return in_groups
