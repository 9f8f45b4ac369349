"""Plant files that come with padwatch load; receivers; settings that cannot be meant."""

import json
import tomllib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from acquisition.clock import SystemClock
from core.machine.channel import Measurand
from core.monitor.monitor import UnitMonitor
from service.app.notifications import receivers_of, router_of
from service.measuring.simulated_sources import simulated_feed
from service.notifications.message import AlarmContext
from service.settings.base import Settings
from service.settings.bearings import BearingSettings
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.films import (
    BaselineModel,
    ChangeLimitSettings,
    FilmAlarmSettings,
    OperatingModel,
)
from service.settings.limits import (
    AmplitudeLimitSettings,
)
from service.settings.plant import DynamicModel, PlantFile, load_plant_file
from service.settings.storage import Origin
from service.settings.toml_file import TomlFileError
from service.settings.transducers import HighPassSettings, ResonanceSettings
from service.store.outbox import no_recipients

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
def test_every_plant_file_that_comes_with_padwatch_loads(path):
    plant = load_plant_file(path)

    for unit in plant.unit:
        machine, calibration = machine_of(unit), calibration_of(unit)
        assert len(calibration.channels) == len(machine.channels)
        assert [b.id for b in machine.bearings] == [b.id for b in unit.bearing]


def test_a_probe_sees_its_gap_shrink_unless_the_file_says_otherwise(plant_text):
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
    plant_text, transducer, sensitivity, sensitivity_unit, unit_per_v
):
    text = plant_text.replace('"proximity_probe"', f'"{transducer}"', 1)
    text = text.replace("sensitivity = 4.0", f"sensitivity = {sensitivity}", 1)
    text = text.replace('"V/mm"', f'"{sensitivity_unit}"', 1)

    channel = calibration_of(load_text(text).unit[0]).channels[0]

    assert channel.unit_per_v == pytest.approx(unit_per_v, rel=1e-12)


def test_speed_and_changes_of_load_are_judged_by_what_the_file_says(plant_text):
    text = "[analysis]\nmax_power_change = 0.1\nspeed_tolerance = 0.01\n"
    plant = load_text(text + plant_text)
    rated = plant.unit[0].model_copy(update={"rated_power_mw": 15.0})

    limits = analysis_of(plant.analysis).sensors
    assert (limits.max_power_change, limits.speed_tolerance) == (0.1, 0.01)
    assert machine_of(rated).rated_power_mw == 15.0


def test_the_shortest_segment_a_file_may_ask_for_gives_results(plant_text):
    analysis = "[analysis]\nsegment_samples = 3121\nmax_frequency_hz = 3.1\n[[unit]]"
    plant = load_text(plant_text.replace("[[unit]]", analysis, 1))
    unit = plant.unit[0]
    feed = simulated_feed(unit, SystemClock())
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))

    results = list(monitor.steps(feed.advance(3200)))

    assert {r.bearing for r in results} == {"UJB", "LJB", "TJB"}
    assert all(r.readings["order1_shaft_x_um_pk"].value for r in results)


@given(choose=st.randoms(), values=st.lists(VALUES, min_size=1, max_size=4))
@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_any_plant_file_yields_a_plant_or_a_refusal(plant_text, tmp_path, choose, values):
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


def test_scaled_counts_are_the_same_channel_without_volts(plant_text):
    plants = [
        PlantFile.model_validate(tomllib.loads(text))
        for text in (plant_text, plant_text.replace(IN_VOLTS, IN_COUNTS, 1))
    ]
    volts, counts = (calibration_of(plant.unit[0]) for plant in plants)
    assert plants[1].unit[0].channel[0].full_scale_v is None
    assert counts.channels[0].unit_per_count == volts.channels[0].unit_per_count
    assert counts.channels[0].ok_limits == pytest.approx(volts.channels[0].ok_limits)
    feeds = [simulated_feed(plant.unit[0], SystemClock()) for plant in plants]
    first, second = (feed.advance(50) for feed in feeds)
    assert [q.level for q in first.channel_quality] == [q.level for q in second.channel_quality]
    assert first.samples == pytest.approx(second.samples, abs=0.1)


HIGH_PASS, RESONANCE = {"kind": "high_pass"}, {"kind": "resonance"}
ABOVE_0, NOT_BELOW_0 = "greater than 0", "greater than or equal to 0"


@pytest.mark.parametrize(
    ("model", "wrong", "said"),
    [
        (AmplitudeLimitSettings, {}, "one of alert and danger must be given"),
        (BaselineModel, {"attitude_width_deg": 7.0}, "must divide 360"),
        (BaselineModel, {"eccentricity_width": 0.0}, "equal to 0.005"),
        (BaselineModel, {"max_surface_std": -1.0}, ABOVE_0),
        (BaselineModel, {"min_days": 0}, "greater than or equal to 1"),
        (BearingSettings, {"thermal_growth_um": -1.0}, NOT_BELOW_0),
        (ChangeLimitSettings, {"alert_change": 0.15}, "must be above alert_change = 0.15"),
        (ChangeLimitSettings, {"danger_change": 0.0}, ABOVE_0),
        (ChangeLimitSettings, {"deadband": 0.04}, "must be below alert_change = 0.035"),
        (ChangeLimitSettings, {"deadband": -0.01}, ABOVE_0),
        (ChangeLimitSettings, {"on_delay_h": 0.0}, ABOVE_0),
        (DynamicModel, {"band_hz": (0.0, 12.0)}, r"must be \[low, high\] with 0 < low < high"),
        (DynamicModel, {"quiet_band_hz": (25.0, 15.0)}, "with 0 < low < high"),
        (FilmAlarmSettings, {"reading_period_s": 3600.0, "time_lapse": 4.0}, "averaging time"),
        (HighPassSettings, HIGH_PASS | {"corner_hz": 1.0, "damping": 0.0}, "equal to 0.05"),
        (OperatingModel, {"settling_s": 0.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": -1.0}, ABOVE_0),
        (OperatingModel, {"full_load_above": 0.06}, "below 0.02, full_load_above minus"),
        (OperatingModel, {"speed_hysteresis": 0.1}, "above speed_hysteresis = 0.1"),
        (ResonanceSettings, RESONANCE | {"natural_hz": -1.0, "damping": 0.1}, "equal to"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(model, wrong, said):
    with pytest.raises(ValidationError) as refused:
        model.model_validate(wrong)
    keys = list(wrong)
    named = [mistake for mistake in refused.value.errors() if mistake["type"] != "missing"]
    assert len(named) == 1
    assert not named[0]["loc"] or named[0]["loc"][0] in keys
    refused.match(said)


def test_no_setting_takes_numbers_that_are_not_finite_or_unknown_keys():
    models = [Settings]
    for model in models:
        models += model.__subclasses__()
        assert model.model_config["allow_inf_nan"] is False, model
        assert model.model_config["extra"] == "forbid", model
    assert len(models) > 30


WEBHOOK = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "https://alarms.example/padwatch?key=1"
secret = { env = "PADWATCH_KEY" }
quiet = { start = "22:00", end = "06:00", time_zone = "America/Asuncion" }
units = ["U1"]
kinds = ["link_lost", "film_stiffness"]
lowest_priority = "danger"
"""

SMTP = """
[[delivery.receiver]]
kind = "smtp"
id = "shift"
host = "mail.example"
username = "padwatch"
password = { file = "/etc/padwatch/mail" }
sender = "padwatch@plant.example"
recipients = ["a@plant.example", "b@plant.example"]
"""


def test_every_recipient_is_a_receiver_and_secrets_in_addresses_are_not_shown(plant_text, tmp_path):
    path = tmp_path / "plant.toml"
    path.write_text(plant_text + WEBHOOK + SMTP, encoding="utf-8")
    plant, clock = load_plant_file(path), SystemClock()

    found = receivers_of(plant, Origin.LIVE, clock)

    assert [(one.name, one.channel.address) for one in found] == [
        ("desk", "https://alarms.example"),
        ("shift:a@plant.example", "a@plant.example"),
        ("shift:b@plant.example", "b@plant.example"),
    ]
    assert found[0].settings.quiet is not None
    midnight_utc_ns, hour_ns = 1_767_225_600_000_000_000, 3600 * 10**9  # 21:00 in Asunción
    quiet = [
        found[0].settings.quiet.include(midnight_utc_ns + hours * hour_ns)
        for hours in range(0, 24, 3)
    ]
    assert quiet == [False, True, True, False, False, False, False, False]
    # A replay tells nobody.
    assert receivers_of(plant, Origin.REPLAY, clock) == []
    assert router_of(plant, Origin.REPLAY, lambda _: AlarmContext(), clock) is no_recipients


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"https://alarms', '"ftp://alarms', "must begin with https:// or http://"),
        ('"https://alarms', '"https://me:you@alarms', "must not contain a user name or password"),
        ('"https://alarms.example/padwatch?key=1"', '"https://a.b/ü"', "must be a URL with a host"),
        ('{ env = "PADWATCH_KEY" }', '"s3cret"', "secret"),
        ('{ env = "PADWATCH_KEY" }', "{}", "exactly one of file and env"),
        ('"22:00"', '"24:00"', "delivery.receiver[1].quiet.start"),
        ('"06:00"', '"22:00"', "must differ from start"),
        ("America/Asuncion", "Mars/Olympus", "is not a known IANA time zone"),
        ('["U1"]', '["U9"]', "unknown unit; known units: U1, U2"),
        ('["link_lost", "film_stiffness"]', '["mood"]', "delivery.receiver[1].kinds[1]"),
        ('"danger"', '"panic"', "lowest_priority"),
        ('id = "shift"', 'id = "desk"', "is used twice"),
        ('username = "padwatch"\n', "", "username and password must be given"),
        ('host = "mail.example"', 'host = "mail.example"\ntls = "none"', "unencrypted"),
        ('"a@plant.example"', '"a@plant.example\\r\\nBcc: x@y.z"', "delivery.receiver[2]"),
        ('"b@plant.example"', '"a@plant.example"', "is used twice"),
    ],
)  # fmt: skip
def test_a_receiver_that_cannot_be_is_refused_by_its_place(old, new, words, plant_text, mistakes):
    text = WEBHOOK + SMTP
    assert old in text

    (said,) = mistakes(plant_text + text.replace(old, new, 1))

    assert words in said
    assert "delivery.receiver[" in said
