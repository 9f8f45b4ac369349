"""A monitor that goes on elsewhere, or with a new description of its unit, loses no average."""

import pickle
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import given_block, with_quality
from rigs.tiers import first_fast

from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import MonitorState, UnitMonitor
from core.quality import GOOD, Reading, Reason, bad, uncertain
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
        found.append(given_block("U1", epoch, first, start_ns, RATE_HZ, samples, quality, slow))
        first += BLOCK
    return found


def said(monitor: UnitMonitor, blocks: Sequence[SampleBlock]) -> list[bytes]:
    """All results and gaps, to the last bit."""
    results: list[bytes] = []
    for block in blocks:
        results += [_bytes(found) for found in monitor.steps(block)]
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
            list(monitor.steps(block))
    monitor.settle(state)
    return monitor


@pytest.mark.parametrize(
    "cut", first_fast(4, [1, 47, 100, 161, 15, 17, 30, 46, 60, 99, 101, 130, 190])
)
def test_a_monitor_that_goes_on_elsewhere_says_the_same(cut):
    blocks = stream(230)
    whole = UnitMonitor(UNIT, SETTINGS)
    whole.go_on(None, n_held=SETTINGS.hop_samples + 30)
    said(whole, blocks[:1])
    assert whole.state.start == 30
    said(whole, blocks[1:cut])
    moved = rebuilt(blocks[:cut], whole.state)
    assert moved.state == whole.state
    assert said(moved, blocks[cut:]) == said(whole, blocks[cut:])


@pytest.mark.parametrize("gap", first_fast(2, [3 * 896, 10**7, 1, 4 * 896, 20 * 896]))
def test_it_says_the_same_wherever_it_was_moved_behind_a_gap_however_long(gap):
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


def test_it_needs_no_more_than_twice_what_is_averaged():
    blocks = stream(100)[46:]
    monitor = UnitMonitor(UNIT, SETTINGS)
    said(monitor, blocks)
    n_needed = blocks[-1].stop_index - monitor.state.start
    assert n_needed <= 2 * SETTINGS.n_segments * SETTINGS.hop_samples + 2 * SETTINGS.segment_samples


SEGMENT, HOP = 8192, 7168


@pytest.fixture
def six_segments(blocks, signals) -> list[SampleBlock]:
    """Six segments of a shaft that turns about (30, 40) µm, with gaps of 2000 µm at its centre."""
    rows = signals((SEGMENT + 5 * HOP) / 600.0, gaps_um=(1970.0, 1960.0))
    return list(blocks(rows, n_each=HOP))


def with_reference(unit: Unit, gap_reference_um: tuple[float, float]) -> Unit:
    (bearing,) = unit.bearings
    return replace(unit, bearings=(replace(bearing, gap_reference_um=gap_reference_um),))


def test_a_new_reference_moves_only_the_shaft_centre_from_the_next_result_on(unit, six_segments):
    monitor = UnitMonitor(unit, AnalysisSettings())
    before = [a for block in six_segments[:3] for a in monitor.steps(block)]

    monitor.replace_description(with_reference(unit, (1970.0, 2000.0)))
    after = [a for block in six_segments[3:] for a in monitor.steps(block)]

    assert before[-1].readings["eccentricity_ratio"].value == pytest.approx(0.25, abs=0.01)
    assert after[0].readings["shaft_centre_x_um"].value == pytest.approx(0.0, abs=1.0)
    assert after[0].readings["shaft_centre_y_um"].value == pytest.approx(40.0, abs=1.0)
    assert after[0].readings["eccentricity_ratio"].value == pytest.approx(0.2, abs=0.01)
    assert after[0].window.n_segments == before[-1].window.n_segments + 1
    assert monitor.unit.bearings[0].gap_reference_um == (1970.0, 2000.0)

    results = []
    for reference in ((2000.0, 2000.0), (1970.0, 2000.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        monitor.replace_description(with_reference(unit, reference))
        results.append([a for block in six_segments for a in monitor.steps(block)][-1].readings)

    differing = {name for name in results[0] if results[0][name] != results[1][name]}

    assert differing == {"shaft_centre_x_um", "eccentricity_ratio", "attitude_angle_deg"}


def test_growth_since_an_older_reference_is_forgotten(unit, blocks, signals):
    """All gaps have grown by 35 µm since the reference; then the opposite probe in x is lost."""
    (bearing,) = unit.bearings
    three = replace(bearing, opposite_x="fx", opposite_reference_um=(2000.0, 2000.0))
    fourth = Channel("fx", Measurand.GAP_UM, 1)
    unit = replace(unit, channels=(*unit.channels, fourth), bearings=(three,))
    rows = signals((SEGMENT + 5 * HOP) / 600.0, gaps_um=(2005.0, 1995.0))
    rows = np.vstack([rows, 4000.0 + 2 * 35.0 - rows[0]])
    lost = (*(GOOD,) * 4, bad(Reason.SENSOR_FAILURE))
    six_segments = [
        block if n < 4 else with_quality(block, lost)
        for n, block in enumerate(blocks(rows, n_each=HOP))
    ]
    for reference in ((2000.0, 2000.0), (2035.0, 2035.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        found = [a for block in six_segments[:4] for a in monitor.steps(block)]
        assert found[-1].readings["gap_growth_um"].value == pytest.approx(35.0, abs=1.0)
        anew = replace(three, gap_reference_um=reference)
        monitor.replace_description(replace(unit, bearings=(anew,)))
        found = [a for block in six_segments[4:] for a in monitor.steps(block)]
        assert found[-1].readings["shaft_centre_y_um"].value == pytest.approx(40.0, abs=1.0)


SWAPPED = Bearing("UJB", 1.18e9, "sy", "sx", "bx", "by", 200.0, (2000.0, 2000.0), "oil")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"id": "U2"}, "id is 'U2', expected 'U1'"),
        ({"rate_hz": 1000.0}, r"rate_hz is 1000\.0, expected 600\.0"),
        ({"channels": ()}, r"channels is \(\), expected \(Channel"),
        ({"rated_speed_rpm": 100.0}, r"rated_speed_rpm is 100\.0, expected 92\.3"),
        ({"speed_channel": None}, "speed_channel is None, expected 'speed'"),
        ({"bearings": ()}, r"bearings is \(\), expected \(\('UJB', "),
        ({"bearings": (SWAPPED,)}, "'sy', 'sx', 'bx', 'by'"),
    ],
)
def test_another_machine_is_refused_naming_what_differs(unit, changes, said):
    monitor = UnitMonitor(unit, AnalysisSettings())

    with pytest.raises(ValueError, match=said):
        monitor.replace_description(replace(unit, **changes))  # type: ignore[arg-type]

    assert monitor.unit is unit
