"""A recording analysed gives what was seen live, to the last bit."""

import dataclasses
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic_core import to_json

from acquisition.delivery.blocks import BlockAssembler, RawBlock, sample_block
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.bearing_readings import UnitEvaluation
from core.monitor.monitor import UnitMonitor
from core.monitor.refresh import Refresh
from core.samples.blocks import Rejection
from service.app.recordings import recording_writer, selection_of
from service.cli.offline.reanalysis import (
    LastAverages,
    assessment_document,
    calibration_differences,
    refreshes,
)
from service.measuring.simulated_sources import simulated_feed
from service.settings.core_values import calibration_of, machine_of
from service.settings.units import UnitSettings

ANALYSIS = AnalysisSettings(segment_samples=1024, n_segments=4)


def rough_ride(unit: UnitSettings, clock) -> Iterator[RawBlock]:
    """A simulated unit with everything that may happen to its samples on the way."""
    feed = simulated_feed(unit, clock)
    for number in range(150):
        raw = feed.advance(60 if number % 7 else 61)
        if number == 20:
            raw.counts[3, 5] = -32768
        if 30 <= number < 34:
            raw = replace(raw, ok=(False, *raw.ok[1:]))
        if 40 <= number < 65:
            raw = replace(raw, slow=(1e6, math.nan, 1e6, *raw.slow[3:]))
        if number in (70, 71):
            continue
        if number == 72:
            raw = replace(raw, rejected=(Rejection("torn", 60),))
        if number >= 110:
            raw = replace(raw, epoch=raw.epoch + 1, first_index=raw.first_index - 6000)
        yield raw


def bits(value: object) -> object:
    """A value in a form that is equal only to the same bits."""
    if dataclasses.is_dataclass(value):
        return {name: bits(part) for name, part in vars(value).items()}
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, dict):
        return {key: bits(part) for key, part in value.items()}
    return value.hex() if isinstance(value, float) else value


async def test_a_recording_analysed_equals_what_was_seen_live_to_the_last_bit(
    unit: UnitSettings, stepped_clock, tmp_path: Path
) -> None:
    machine, calibration = machine_of(unit), calibration_of(unit)
    live_monitor, live = UnitMonitor(machine, ANALYSIS), []
    with recording_writer(unit, tmp_path / "run", "a test") as writer:
        delivery = BlockAssembler(calibration)
        blocks = [b for raw in rough_ride(unit, stepped_clock) for b in delivery.take(raw)]
        for block in blocks + delivery.flush():
            live += live_monitor.ingest(block)
            writer.write_block(block)

    recording = open_recording(tmp_path / "run")
    source = RecordingSource(recording, stepped_clock, selection_of(recording, unit))
    monitor, n_passed = UnitMonitor(machine, ANALYSIS), []
    again = [found.assessment() async for found in refreshes(source, monitor, n_passed.append)]

    assert len(live) > 3 * 5
    reasons = {reading.quality.reason.value for a in live for reading in a.readings.values()}
    assert reasons >= {"sensor_failure", "clipped", "out_of_range"}
    assert bits(dict(enumerate(again))) == bits(dict(enumerate(live)))
    assert monitor.account == live_monitor.account
    assert monitor.drain_gaps() == live_monitor.drain_gaps() != []
    assert sum(n_passed) == recording.manifest.n_samples


@pytest.fixture
def one(unit: UnitSettings, stepped_clock) -> Refresh:
    monitor, feed = UnitMonitor(machine_of(unit), ANALYSIS), simulated_feed(unit, stepped_clock)
    return next(monitor.refreshes(sample_block([feed.advance(1024)], calibration_of(unit))))


@pytest.fixture
def sample(one: Refresh) -> Assessment:
    return one.assessment()


def averaged(one: Refresh, bearing: str, first_index: int, n_usable: int) -> Refresh:
    """A refresh of four segments in which that many are usable."""
    kept = one.kept.snapshot()
    [segment] = kept.segments
    usable = [np.full_like(segment.order_usable, n < n_usable) for n in range(4)]
    kept.segments.clear()
    kept.segments.extend(
        replace(segment, first_index=first_index, order_usable=each) for each in usable
    )
    bearings = {bearing.id: bearing for bearing in one.unit.bearings}
    evaluation = UnitEvaluation(one.unit, ANALYSIS, kept, one.evaluation.n_expected)
    return replace(one, bearing=bearings[bearing], evaluation=evaluation)


@pytest.mark.parametrize(
    ("n_segments", "kept"), [((1, 2, 3), 2), ((1, 4, 4), 2), ((3, 4, 2), 1), ((4, 4, 0), 1)]
)
def test_the_last_full_average_is_kept_and_the_last_of_all_until_there_is_one(
    one: Refresh, n_segments: tuple[int, ...], kept: int
) -> None:
    last = LastAverages()
    for number, n in enumerate(n_segments):
        last.put(averaged(one, "UJB", number, n))
        last.put(averaged(one, "LJB", 70 + number, 4))
    found = [(a.bearing, a.window.first_index) for a in (each.assessment() for each in last.all())]
    assert found == [("UJB", kept), ("LJB", 72)]


def test_an_assessment_has_every_digit_in_json(sample: Assessment) -> None:
    found = json.loads(to_json(assessment_document(sample)))
    for name, reading in sample.readings.items():
        assert found["readings"][name]["value"] == reading.value
        assert found["readings"][name]["reason"] == reading.quality.reason.value
    named = {"unit", "bearing", "time", "quality", "speed_source", "runout", "window", "readings"}
    assert set(found) == {*named, "estimators"}
    assert found["estimators"] == sample.estimators


def test_a_changed_sensitivity_and_range_are_named_with_both_values(unit: UnitSettings) -> None:
    then = calibration_of(unit)
    now = replace(
        then,
        channels=(replace(then.channels[0], unit_per_v=251.5), *then.channels[1:]),
        slow=(replace(then.slow[0], maximum=300.0), *then.slow[1:]),
    )
    ids = [channel.id for channel in unit.channel]
    assert calibration_differences(ids, then, now) == [
        "channel ujb_shaft_x: unit_per_v was 250 when recorded, is 251.5 now",
        "slow channel speed: range was 0 to 200, is 0 to 300 now",
    ]
    assert calibration_differences(ids, then, then) == []
