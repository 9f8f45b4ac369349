"""Analysis offline: recordings as they were seen live, back-tests, `padwatch validate`."""

import dataclasses
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from pydantic_core import to_json
from rigs.assessments import assessment
from rigs.command_line import padwatch
from typer.testing import CliRunner

from acquisition.delivery.blocks import BlockAssembler
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.bearing_readings import UnitEvaluation
from core.monitor.monitor import UnitMonitor
from core.monitor.refresh import Refresh
from core.quality import Reading
from core.samples.blocks import Rejection, SampleBlock
from service.app.recordings import recording_writer, selection_of
from service.cli import validate as command
from service.cli.offline import validation as paper
from service.cli.offline.reanalysis import (
    LastAverages,
    assessment_document,
    calibration_differences,
    refreshes,
    stiffness_lines,
)
from service.measuring.simulated_sources import simulated_feed
from service.settings.core_values import calibration_of, machine_of
from service.settings.units import UnitSettings

ANALYSIS = AnalysisSettings(segment_samples=1024, n_segments=4)


def rough_ride(unit: UnitSettings, clock) -> Iterator[SampleBlock]:
    """A simulated unit with everything that may happen to its samples on the way."""
    feed = simulated_feed(unit, clock)
    for number in range(150):
        raw = feed.advance(60 if number % 7 else 61)
        if number == 20:
            raw.counts[3, 5] = -32768
        if 30 <= number < 34:
            raw.side.ok[0] = False
        if 40 <= number < 65:
            raw.side.slow[:3, 0] = 1e6, math.nan, 1e6
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


async def test_an_analysed_recording_equals_live_to_the_last_bit(unit, stepped_clock, tmp_path):
    machine, calibration = machine_of(unit), calibration_of(unit)
    live_monitor, live = UnitMonitor(machine, ANALYSIS), []
    with recording_writer(unit, tmp_path / "run", "a test") as writer:
        delivery = BlockAssembler(calibration)
        blocks = [b for raw in rough_ride(unit, stepped_clock) for b in delivery.take([raw])]
        for block in blocks + delivery.flush():
            live += live_monitor.steps(block)
            writer.write(block)

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
    return next(monitor.refreshes(feed.advance(1024)))


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
def test_the_last_full_average_is_kept_and_the_last_of_all_until_then(one, n_segments, kept):
    last = LastAverages()
    for number, n in enumerate(n_segments):
        last.put(averaged(one, "UJB", number, n))
        last.put(averaged(one, "LJB", 70 + number, 4))
    found = [(a.bearing, a.window.first_index) for a in (each.assessment() for each in last.all())]
    assert found == [("UJB", kept), ("LJB", 72)]


def test_an_assessment_has_every_digit_in_json(sample):
    found = json.loads(to_json(assessment_document(sample)))
    for name, reading in sample.readings.items():
        assert found["readings"][name]["value"] == reading.value
        assert found["readings"][name]["reason"] == reading.quality.reason.value
    named = {"unit", "bearing", "time", "quality", "speed_source", "runout", "window", "readings"}
    assert set(found) == {*named, "estimators"}
    assert found["estimators"] == sample.estimators


def test_a_changed_sensitivity_and_range_are_named_with_both_values(unit):
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


def runner_result(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command.validate)
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.stdout


def test_validate_prints_every_table_or_as_json_a_row_for_every_figure():
    exit_code, text = runner_result()

    assert exit_code == 0
    for place in ("Table 4", "Table 5", "Table 6", "Table 7", "Table 8", "Table 9", "Section 3.2"):
        assert place in text
    assert "80 amplitudes" in text
    assert "20 of 20 stiffnesses" in text

    exit_code, text = runner_result("--json")
    rows = json.loads(text)

    assert exit_code == 0
    assert len(rows) == 100
    keys = ("table", "condition", "bearing", "quantity", "paper", "padwatch", "error_percent")
    assert set(rows[0]) == set(keys)
    *_, printed, found, error_percent = (rows[0][key] for key in keys)
    assert error_percent == pytest.approx(100 * (found / printed - 1))


def test_validate_fails_when_a_printed_figure_is_not_explained(monkeypatch):
    wrong = paper.MeasuredRow(8, "G6.65 t0", "UJB", "55", "20", "0.46")
    monkeypatch.setattr(paper, "MEASURED", (wrong, *paper.MEASURED[1:]))

    exit_code, text = runner_result()

    assert exit_code == 1
    assert "19 of 20" in text


HEADINGS = (
    "time,unit,bearing,direction,k_n_per_m,u_random,eccentricity_ratio,oil_temperature_c,quality"
)


def rows(n: int, bearing: str = "UJB", cells: str = "1e9,0.01,0.3,40.5") -> list[str]:
    return [
        f"2025-01-{1 + i // 144:02d}T{i // 6 % 24:02d}:{i % 6}0:00Z,U1,{bearing},{d},{cells},good"
        for i in range(n)
        for d in "xy"
    ]


@pytest.fixture
def readings(tmp_path: Path) -> Path:
    """Four days at part load, which is too little to learn from."""
    path = tmp_path / "readings.csv"
    lines = [HEADINGS + ",state", *(line + ",part_load" for line in rows(576))]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_report_is_one_json_document(readings):
    result = padwatch("backtest", readings, "--learn-days", 2, "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["rows"] == 2 * 576
    assert [(f["unit"], f["bearing"], f["direction"]) for f in report["films"]] == [
        ("U1", "UJB", "x"),
        ("U1", "UJB", "y"),
    ]
    film = report["films"][0]
    assert film["learning"] == 288
    assert film["verdicts"]["no_baseline"] == 288
    assert film["baselines"][0]["is_learned"] is False
    assert report["rate"] == {
        "unit_years": pytest.approx(2 / 365.25, rel=0.01),
        "n_alarms": 0,
        "n_danger": 0,
        "alarms_per_unit_year": None,
    }
    assert report["doubts"] == ["U1 UJB: no attitude_deg, so its baseline does not use it"]
    assert report["readings_per_s"] > 0.0


def test_people_get_tables(readings):
    result = padwatch("backtest", readings)
    assert result.exit_code == 0
    for words in ("Readings by verdict", "U1 UJB x", "too few readings to learn", "Alarms: 0"):
        assert words in result.stdout


def test_every_row_counts_whatever_is_to_be_learned_first(readings):
    until = padwatch("backtest", readings, "--learn-until", "2025-01-02T00:00:00Z", "--json")
    assert json.loads(until.stdout)["films"][1]["learning"] == 144
    event = ["--event", "U1/UJB 2025-01-03T00:00:00Z new pads", "--learn-days", 1]
    film = json.loads(padwatch("backtest", readings, *event, "--json").stdout)["films"][0]
    assert [b["event"] for b in film["baselines"]] == ["", "new pads"]
    assert film["learning"] == 2 * 144


def test_units_are_those_of_the_plant_file(readings, plant_path):
    assert padwatch("backtest", readings, "--plant", plant_path).exit_code == 0
    text = readings.read_text(encoding="utf-8").replace(",U1,UJB,y", ",U7,UJB,y", 1)
    readings.write_text(text, encoding="utf-8")
    result = padwatch("backtest", readings, "--plant", plant_path)
    assert result.exit_code == 1
    assert result.stderr == f"padwatch backtest: {readings}: line 3: unknown unit 'U7'\n"


def test_settings_are_tried_and_wrong_ones_refused_with_their_line(readings, tmp_path):
    settings = tmp_path / "settings.toml"
    settings.write_text("reading_period_s = 3600.0\nlearning_days = 1.0\n", encoding="utf-8")
    report = json.loads(padwatch("backtest", readings, "--settings", settings, "--json").stdout)
    assert report["films"][0]["learning"] == 144
    assert any("are 10 min apart" in doubt for doubt in report["doubts"])
    settings.write_text("[change]\nalert_change = 0.2\ndanger_change = 0.1\n", encoding="utf-8")
    result = padwatch("backtest", readings, "--settings", settings)
    assert result.exit_code == 2
    assert f"{settings}:3: change.danger_change = 0.1: must be above alert_change" in result.stderr
    settings.write_text("[change]\nalert = 0.2\n", encoding="utf-8")
    assert padwatch("backtest", readings, "--settings", settings).exit_code == 2


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["--learn-until", "2025-01-02"], 2, "requires an offset from UTC"),
        (["--learn-days", "0"], 2, "greater than or equal to 1"),
        (["--event", "overhaul"], 2, "is not an event such as"),
        (["--event", "U9 2025-01-02T00:00:00Z"], 1, "event of U9: the file has no readings of U9"),
        (["--export", "."], 2, ".: the file or folder exists already"),
    ],
)
def test_wrong_options_are_refused(readings, options, code, says):
    result = padwatch("backtest", readings, *options)
    assert (result.exit_code, result.stdout) == (code, "")
    assert says in result.stderr


def test_states_are_not_needed_where_speed_and_power_tell(readings, plant_path):
    lines = [HEADINGS + ",speed_rpm,power_mw", *(line + ",92.3,500" for line in rows(20))]
    readings.write_text("\n".join(lines), encoding="utf-8")
    rated = "rated_power_mw = 700.0\nrated_speed_rpm"
    plant_path.write_text(plant_path.read_text().replace("rated_speed_rpm", rated, 1))
    assert padwatch("backtest", readings, "--plant", plant_path).exit_code == 0


def test_a_film_on_an_unknown_bracket_is_told_as_a_ratio_to_it():
    ratio = Reading(0.585, interval_95=(0.57, 0.60))
    x, y = stiffness_lines(assessment(stiffness_xx_of_kb=ratio))
    assert x == "U1 UJB film stiffness xx: 0.585 ± 0.015 k_b (95 %)"
    assert y.endswith("not available: not measured")
