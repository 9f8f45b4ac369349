"""A rack that gives amplitudes, and perhaps phases: its rows, its polls, its monitor."""

from dataclasses import replace

import numpy as np

from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Quality, Reading
from core.samples.blocks import SampleBlock
from core.spectra.polls import PollSettings, PollTransform, VectorPart, VectorRow
from rigs.blocks import given_block

RATE_HZ = 0.2
K_B = 1.18e9
AVERAGING = PollSettings(n_polls=60, hop_polls=12, min_polls=4)
AMPLITUDES = tuple(VectorRow(id_, VectorPart.ORDER1_AMPLITUDE) for id_ in ("sx", "sy", "bx", "by"))
PHASES = tuple(VectorRow(id_, VectorPart.ORDER1_PHASE) for id_ in ("sx", "sy", "bx", "by"))
GAPS = tuple(VectorRow(id_, VectorPart.GAP) for id_ in ("sx", "sy"))
VORTEX = tuple(VectorRow(id_, VectorPart.VORTEX_AMPLITUDE) for id_ in ("sx", "sy", "bx", "by"))
SLOW = {"speed": Reading(92.3), "power": Reading(650.0), "oil": Reading(45.0)}


def monitor_of(unit: Unit, rows: tuple[VectorRow, ...] = AMPLITUDES, **changes) -> UnitMonitor:
    """A monitor of a unit whose shaft channels count motion towards the probe."""
    channels = tuple(replace(channel, direction=1) for channel in unit.channels)
    averaging = changes.pop("averaging", AVERAGING)
    bearing = replace(unit.bearings[0], **changes.pop("bearing", {}))
    there = replace(unit, rate_hz=RATE_HZ, bearings=(bearing,), channels=channels, **changes)
    settings = AnalysisSettings()
    return UnitMonitor(there, settings, PollTransform(there, rows, settings, averaging))


def polls(
    *rows: float, n: int = 60, noise: float = 0.01, seed: int = 1, **settings
) -> list[SampleBlock]:
    """Polls of constant rows with a little relative noise."""
    wobble = 1.0 + noise * np.random.default_rng(seed).normal(size=(len(rows), n))
    return blocks_of(np.array(rows)[:, np.newaxis] * wobble, **settings)


def blocks_of(
    values,
    first_index: int = 0,
    epoch: int = 1,
    slow: dict[str, Reading] = SLOW,
    quality: dict[int, Quality] | None = None,
    n_each: int = 1,
) -> list[SampleBlock]:
    n_rows, n = values.shape
    return [
        given_block(
            unit="U1",
            epoch=epoch,
            first_index=first_index + start,
            start_ns=round((first_index + start) / RATE_HZ * 1e9),
            rate_hz=RATE_HZ,
            samples=values[:, start : start + n_each].astype(np.float32),
            channel_quality=tuple((quality or {}).get(row, GOOD) for row in range(n_rows)),
            slow=slow,
        )
        for start in range(0, n, n_each)
    ]


def watch(monitor: UnitMonitor, stream: list[SampleBlock]) -> list[Assessment]:
    return [assessment for block in stream for assessment in monitor.steps(block)]
