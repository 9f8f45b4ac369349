"""Plant files that come with padwatch load, and no file at all brings the loader down."""

import json
import random
import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import sample_block
from core.machine.channel import Measurand
from core.monitor.monitor import UnitMonitor
from service.measuring.simulated_sources import simulated_feed
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.settings.toml_file import TomlFileError

DEPLOY = Path(__file__).parents[3] / "deploy"

VALUES = st.one_of(
    st.text(max_size=8).map(json.dumps),
    st.integers().map(str),
    st.floats().map(repr),
    st.lists(st.floats(), max_size=3).map(repr),
    st.sampled_from(
        ['"ujb_shaft_x"', '"UJB"', '"speed"', '"V/mm"', "0", "-1", "true", "{ a = 1 }", "]["]
    ),
)
"""Texts in the place of a value: most are TOML."""


@pytest.mark.parametrize("path", sorted(DEPLOY.glob("*.toml")), ids=lambda path: path.name)
def test_every_plant_file_that_comes_with_padwatch_loads(path: Path) -> None:
    plant = load_plant_file(path)

    for unit in plant.unit:
        machine, calibration = machine_of(unit), calibration_of(unit)
        assert len(calibration.channels) == len(machine.channels)
        assert [b.id for b in machine.bearings] == [b.id for b in unit.bearing]


def test_a_probe_sees_its_gap_shrink_unless_the_file_says_otherwise(plant_text: str) -> None:
    unit = load_text(plant_text).unit[0]
    turned = load_text(
        plant_text.replace('"proximity_probe"', '"proximity_probe"\ndirection = 1', 1)
    )

    assert [c.direction for c in machine_of(unit).channels[:4]] == [-1, -1, 1, 1]
    assert machine_of(turned.unit[0]).channels[0].direction == 1
    assert machine_of(unit).channels[0].measurand is Measurand.GAP_UM


@pytest.mark.parametrize(
    ("transducer", "sensitivity", "sensitivity_unit", "unit_per_v"),
    [
        ("proximity_probe", "-4.0", "V/mm", -250.0),
        ("proximity_probe", "8.0", "mV/um", 125.0),
        ("velocity", "100.0", "mV/(mm/s)", 10.0),
        ("accelerometer", "1000.0", "mV/g", 9.80665),
        ("accelerometer", "100.0", "mV/(m/s2)", 10.0),
    ],
)
def test_a_sensitivity_becomes_engineering_units_per_volt(
    plant_text: str, transducer: str, sensitivity: str, sensitivity_unit: str, unit_per_v: float
) -> None:
    text = plant_text.replace('"proximity_probe"', f'"{transducer}"', 1)
    text = text.replace("sensitivity = 4.0", f"sensitivity = {sensitivity}", 1)
    text = text.replace('"V/mm"', f'"{sensitivity_unit}"', 1)

    channel = calibration_of(load_text(text).unit[0]).channels[0]

    assert channel.unit_per_v == pytest.approx(unit_per_v, rel=1e-12)


def test_speed_and_changes_of_load_are_judged_by_what_the_file_says(plant_text: str) -> None:
    text = "[analysis]\nmax_power_change = 0.1\nspeed_tolerance = 0.01\n"
    plant = load_text(text + plant_text)
    rated = plant.unit[0].model_copy(update={"rated_power_mw": 15.0})

    limits = analysis_of(plant.analysis).sensors
    assert (limits.max_power_change, limits.speed_tolerance) == (0.1, 0.01)
    assert machine_of(rated).rated_power_mw == 15.0


def test_the_shortest_segment_a_file_may_ask_for_gives_results(plant_text: str) -> None:
    analysis = "[analysis]\nsegment_samples = 3121\nmax_frequency_hz = 3.1\n[[unit]]"
    plant = load_text(plant_text.replace("[[unit]]", analysis, 1))
    unit = plant.unit[0]
    feed = simulated_feed(unit, SystemClock())
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))

    results = monitor.ingest(sample_block([feed.advance(3200)], calibration_of(unit)))

    assert {r.bearing for r in results} == {"UJB", "LJB", "TJB"}
    assert all(r.readings["order1_shaft_x_um_pk"].value for r in results)


@given(choose=st.randoms(), values=st.lists(VALUES, min_size=1, max_size=4))
@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_no_plant_file_ever_yields_anything_but_a_plant_or_a_refusal(
    plant_text: str, tmp_path: Path, choose: random.Random, values: list[str]
) -> None:
    """Lines of a right file are dropped, or have another key or value."""
    lines = plant_text.partition('[[unit]]\nid = "U2"')[0].splitlines()
    lines = [line for line in lines if line and not line.startswith("#")]
    for value in values:
        n = choose.randrange(len(lines))
        key, is_set, old = lines[n].partition(" = ")
        anew = (f"{value} = {old}", f"{key} = {value}") if is_set else (f"{key}\nx = {value}",)
        lines[n] = choose.choice(("", *anew, *anew))
    path = tmp_path / "plant.toml"
    path.write_text("\n".join(lines), encoding="utf-8", errors="replace")

    try:
        plant = load_plant_file(path)
    except TomlFileError as refusal:
        refused = str(refusal).split("\n")
        assert all(line.startswith(f"{path}:") for line in refused)
    else:
        assert isinstance(plant, PlantFile)
        for unit in plant.unit:
            calibration_of(unit)
            machine_of(unit)


def load_text(text: str) -> PlantFile:
    return PlantFile.model_validate(tomllib.loads(text))


IN_VOLTS = """sensitivity = 4.0
sensitivity_unit = "V/mm"
full_scale_v = 12.0
ok_min_v = 1.0
ok_max_v = 11.0
"""
IN_COUNTS = """unit_per_count = 0.091552734375
ok_min = 250.0
ok_max = 2750.0
"""


def test_scaled_counts_are_the_same_channel_without_volts(plant_text: str) -> None:
    plants = [
        PlantFile.model_validate(tomllib.loads(text))
        for text in (plant_text, plant_text.replace(IN_VOLTS, IN_COUNTS, 1))
    ]
    volts, counts = (calibration_of(plant.unit[0]) for plant in plants)
    assert plants[1].unit[0].channel[0].full_scale_v is None
    assert counts.channels[0].unit_per_count == volts.channels[0].unit_per_count
    assert counts.channels[0].ok_limits == pytest.approx(volts.channels[0].ok_limits)
    feeds = [simulated_feed(plant.unit[0], SystemClock()) for plant in plants]
    first, second = (
        sample_block([feed.advance(50)], calibration)
        for feed, calibration in zip(feeds, (volts, counts), strict=True)
    )
    assert [q.level for q in first.channel_quality] == [q.level for q in second.channel_quality]
    assert first.samples == pytest.approx(second.samples, abs=0.1)
