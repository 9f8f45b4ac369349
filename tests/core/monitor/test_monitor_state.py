"""A monitor that goes on elsewhere says to the last bit what the one would have that was there."""

import pickle
from collections.abc import Sequence

import numpy as np
import pytest
from rigs.blocks import given_block

from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import MonitorState, UnitMonitor
from core.quality import GOOD, Reading, Reason, uncertain
from core.samples.blocks import SampleBlock

RATE_HZ, BLOCK = 100.0, 64
SETTINGS = AnalysisSettings(segment_samples=1024, n_segments=4, min_segments=2)
UNIT = Unit(
    "U1",
    60.0,
    RATE_HZ,
    tuple(Channel(id_, Measurand.DISPLACEMENT_UM) for id_ in ("sx", "sy", "bx", "by")),
    (Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0)),),
    speed_channel="speed",
    has_vortex=True,
)


def stream(n_blocks: int, gap: int = 500) -> list[SampleBlock]:
    """A shaft with a wandering vortex, noise, two gaps and a restart of its device."""
    rng = np.random.default_rng(5)
    found, first, epoch = [], 0, 1
    for number in range(n_blocks):
        if number in (45, 160):
            first += gap
        if number == 100:
            epoch, first = 2, 0
        t = (number * BLOCK + np.arange(BLOCK)) / RATE_HZ
        vortex = 20 * np.cos(2 * np.pi * (0.25 + 0.04 * np.sin(number / 30)) * t)
        turning = np.array([50 * np.cos(2 * np.pi * t), 50 * np.sin(2 * np.pi * t)]) + vortex
        samples = np.concatenate([turning, turning / 5]) + rng.normal(0.0, 1.0, (4, BLOCK))
        quality = (GOOD, GOOD, GOOD, uncertain(Reason.CLIPPED) if number == 70 else GOOD)
        start_ns = 1_767_225_600_000_000_000 + round(t[0] * 1e9)
        samples = samples.astype(np.float32)
        slow = {"speed": Reading(60.0 + 0.1 * np.sin(number / 9))}
        block = given_block("U1", epoch, first, start_ns, RATE_HZ, samples, quality, slow)
        found.append(block)
        first += BLOCK
    return found


def said(monitor: UnitMonitor, blocks: Sequence[SampleBlock]) -> list[bytes]:
    """All results and gaps, to the last bit."""
    results: list[bytes] = []
    for block in blocks:
        results += [_bytes(found) for found in monitor.ingest(block)]
        results += [pickle.dumps(gap) for gap in monitor.drain_gaps()]
    return results


def _bytes(found: Assessment) -> bytes:
    return repr(
        [
            found.time_ns,
            found.window,
            found.quality,
            dict(found.readings),
            found.spectrum.matrix.tobytes(),
            found.orbit.shaft_x_um.tobytes() if found.orbit else None,
        ]
    ).encode()


def rebuilt(blocks: Sequence[SampleBlock], state: MonitorState) -> UnitMonitor:
    monitor = UnitMonitor(UNIT, SETTINGS)
    monitor.rewind(state)
    for block in blocks:
        if block.epoch == state.epoch and block.stop_index > state.start:
            monitor.ingest(block)
    monitor.settle(state)
    return monitor


@pytest.mark.parametrize("cut", [1, 15, 17, 30, 46, 47, 60, 99, 100, 101, 130, 161, 190])
def test_a_monitor_that_goes_on_elsewhere_says_the_same(cut: int) -> None:
    blocks = stream(230)
    whole = UnitMonitor(UNIT, SETTINGS)
    said(whole, blocks[:cut])
    moved = rebuilt(blocks[:cut], whole.state)
    assert moved.account == whole.account
    assert moved.state == whole.state
    assert said(moved, blocks[cut:]) == said(whole, blocks[cut:])


@pytest.mark.parametrize("gap", [1, 3 * 896, 4 * 896, 20 * 896, 10**7])
def test_it_says_the_same_wherever_it_was_moved_behind_a_gap_however_long(gap: int) -> None:
    blocks = stream(98, gap)
    whole = UnitMonitor(UNIT, SETTINGS)
    told: list[list[bytes]] = []
    states: list[MonitorState] = []
    for block in blocks:
        states.append(whole.state)
        told.append(said(whole, [block]))
    for cut in range(46, 90, 4):
        moved = rebuilt(blocks[:cut], states[cut])
        assert moved.state == states[cut]
        assert [said(moved, [block]) for block in blocks[cut:]] == told[cut:]


def test_it_needs_no_more_than_twice_what_is_averaged() -> None:
    blocks = stream(100)[46:]
    monitor = UnitMonitor(UNIT, SETTINGS)
    said(monitor, blocks)
    n_needed = blocks[-1].stop_index - monitor.state.start
    assert n_needed <= 2 * SETTINGS.n_segments * SETTINGS.hop_samples + 2 * SETTINGS.segment_samples
