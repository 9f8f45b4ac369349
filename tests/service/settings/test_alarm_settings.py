"""Alarms and captures in the plant file: what fits is a rule of a known kind of alarm."""

import re
import tomllib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from unittest.mock import MagicMock

import pytest

from core.alarms import kinds as units
from core.alarms.alarm import AlarmRule
from core.alarms.judgements import OrderVector, VectorReference
from core.alarms.rules import EVERY_STATE, BearingRules, LimitRule, Region, UnitRules
from core.alarms.statistics import ChatterRule
from core.condition.cells import OperatingPoint
from core.condition.operating_state import STEADY, OperatingState
from core.limits import Limits
from core.machine.unit import Bearing
from core.monitor.catalogue import CATALOGUE
from service.app.analysis import Analysis
from service.app.kept_files import captures_of
from service.measuring.service_alarms import service_rules_of
from service.settings.alarm_kinds import ALARM_KINDS, SERVICE_KINDS
from service.settings.alarms import AlarmSettings
from service.settings.core_values import chatter_rule_of, references_of, rules_of
from service.settings.plant import PlantFile
from service.settings.storage import Origin

PlantOf = Callable[..., PlantFile]

SECOND = 1_000_000_000
EVERY_KNOWN_STATE = EVERY_STATE - {OperatingState.UNKNOWN}
FULL, PART = OperatingState.FULL_LOAD, OperatingState.PART_LOAD
UJB = "unit[1].bearing[1].alarms."
OIL = 'oil_temperature = "ujb_oil_temperature"'


@pytest.fixture
def plant_of(plant_text: str) -> PlantOf:
    """Builds the demonstration plant with more keys for its first bearing, and more tables."""

    def build(bearing: str = "", tables: str = "") -> PlantFile:
        text = plant_text.replace(OIL, f"{OIL}\n{bearing}", 1)
        return PlantFile.model_validate(
            tomllib.loads(text.replace("[[unit]]", f"{tables}\n[[unit]]", 1))
        )

    return build


@pytest.fixture
def rules(plant_of: PlantOf) -> Callable[[str], BearingRules]:
    """Builds the rules of the first bearing from its keys."""

    def build(keys: str) -> BearingRules:
        plant = plant_of(keys)
        return rules_of(plant.unit[0], plant.alarms, Origin.LIVE).bearings["UJB"]

    return build


def test_without_limits_no_bearing_is_watched_and_in_a_replay_neither_link_nor_clock(plant_of):
    plant = plant_of()

    rules = rules_of(plant.unit[0], plant.alarms, Origin.LIVE)

    assert all(set(found.values()) == {None} for found in rules.bearings.values())
    assert rules.channel == AlarmRule(SECOND // 2, 10 * SECOND)
    assert rules.link == AlarmRule(10 * SECOND, 0)
    assert rules.clock_offset is not None
    assert rules.clock_offset.limits == Limits(2.0, deadband=0.2)

    rules = rules_of(plant.unit[0], plant.alarms, Origin.REPLAY)

    assert {rules.link, rules.clock_offset, rules.clock_drift, rules.time_stamps} == {None}
    assert captures_of(plant, Origin.REPLAY, None)._histories == {}  # type: ignore[arg-type]
    assert set(captures_of(plant, Origin.LIVE, None)._histories) == {"U1", "U2"}  # type: ignore[arg-type]


def test_limits_of_a_bearing_become_its_rules_at_speed_unless_said_otherwise(rules):
    found = rules(
        "alarms.shaft_order1_um_pk = { alert = 150.0, danger = 250.0, on_delay_s = 0.0 }\n"
        "alarms.oil_temperature_c = { danger = 75.0, deadband = 2.0, off_delay_s = 1.5 }\n"
        "alarms.shaft_overall_um_pp = { alert = 300.0,"
        ' states = ["part_load", "run_down"], latching = true }\n'
        "alarms.gap_um = { danger_below = 400.0, alert_below = 600.0,"
        " alert = 2400.0, danger = 2600.0 }\n"
        "alarms.bearing_overall_mm_s_rms = { alert = 2.0 }\n"
        "alarms.eccentricity_ratio = { danger = 0.9 }\n"
        "alarms.shaft_order1_change_um_pk = { alert = 30.0 }"
    )

    assert found["shaft_order1"] == LimitRule(
        Limits(150.0, 250.0, 5.0), AlarmRule(0, 30 * SECOND), STEADY
    )
    assert found["oil_temperature"] == LimitRule(
        Limits(None, 75.0, 2.0), AlarmRule(10 * SECOND, 3 * SECOND // 2), EVERY_KNOWN_STATE
    )
    assert found["shaft_overall"] is not None
    assert found["shaft_overall"].states == {PART, OperatingState.RUN_DOWN}
    assert found["shaft_overall"].rule.is_latching
    assert found["gap"] is not None
    assert found["gap"].limits == Limits(2400.0, 2600.0, 10.0, 600.0, 400.0)
    for rule in (found["bearing_overall"], found["eccentricity"], found["shaft_change"]):
        assert isinstance(rule, LimitRule)
        assert rule.states == STEADY
        assert not rule.rule.is_latching


def test_zones_differ_from_state_to_state(rules):
    found = rules(
        "alarms.zones.shaft_um_pp = { off_delay_s = 5.0, table = [\n"
        '  { states = ["full_load"], a_b = 100.0, b_c = 200.0, c_d = 300.0 },\n'
        '  { states = ["part_load"], a_b = 150.0, b_c = 250.0, c_d = 400.0, deadband = 1.0 }] }'
    )["shaft_zones"]

    assert found is not None
    [full], [part] = (found.at(OperatingPoint(state)) for state in (FULL, PART))
    assert (full.alert, full.danger, full.deadband) == (200.0, 300.0, 5.0)
    assert (part.alert, part.danger, part.deadband) == (250.0, 400.0, 1.0)
    assert not found.at(OperatingPoint(OperatingState.SPEED_NO_LOAD))
    assert found.rule.off_delay_ns == 5 * SECOND


def test_every_limit_may_differ_by_operating_state_and_by_condition_cell(rules):
    cell = "eccentricity_ratio = [0.35, 0.4], oil_temperature_c = [45.0, 47.5]"
    found = rules(
        "alarms.shaft_order1_um_pk = { alert = 150.0, danger = 250.0, table = ["
        ' { states = ["part_load"], alert = 180.0 },'
        f' {{ states = ["full_load"], {cell}, alert = 120.0, deadband = 3.0 }}] }}\n'
        "alarms.gap_um = { alert_below = 600.0, alert = 2400.0, table = ["
        " { attitude_deg = [0.0, 90.0], alert_below = 500.0 }] }\n"
        "alarms.zones.shaft_um_pp = { table = ["
        f" {{ {cell}, a_b = 100.0, b_c = 200.0, c_d = 300.0 }}] }}"
    )

    assert found["shaft_order1"] is not None
    assert found["shaft_order1"].tables == (
        (Region(frozenset({PART})), Limits(180.0, 250.0, 5.0)),
        (Region(frozenset({FULL}), (0.35, 0.4), (45.0, 47.5)), Limits(120.0, 250.0, 3.0)),
    )
    assert found["gap"] is not None
    [(region, limits)] = found["gap"].tables
    assert region == Region(STEADY, attitude_deg=(0.0, 90.0))
    assert limits == Limits(2400.0, None, 10.0, 500.0)
    assert found["shaft_zones"] is not None
    [(region, _)] = found["shaft_zones"].tables
    assert region == Region(STEADY, (0.35, 0.4), (45.0, 47.5))


def test_a_reference_holds_in_each_state_it_names(plant_of):
    found = references_of(
        plant_of(
            "alarms.order1_reference = ["
            ' { states = ["part_load", "full_load"], shaft_x = [60.0], bearing_y = [20.0] }]'
        ).unit[0]
    )

    vectors = {"shaft_x": OrderVector(60.0), "bearing_y": OrderVector(20.0)}
    expected = [VectorReference("U1", "UJB", state, vectors) for state in (PART, FULL)]
    assert sorted(found, key=lambda r: r.state) == expected


def test_clocks_captures_and_chattering_can_be_set(plant_of):
    plant = plant_of(
        tables='[alarms]\nclock = "ignored"\nchattering_activations = 5\n'
        'chattering_window_s = 600.0\n[capture]\nsamples = "not_kept"'
    )

    assert rules_of(plant.unit[0], plant.alarms, Origin.LIVE).clock_drift is None
    assert captures_of(plant, Origin.LIVE, None)._histories == {}  # type: ignore[arg-type]
    assert chatter_rule_of(plant.alarms) == ChatterRule(5, 600 * SECOND)
    assert chatter_rule_of(plant_of().alarms) == ChatterRule(3, 60 * SECOND)


ORDER1, SPAN, ECCENTRICITY = "shaft_order1_um_pk", "shaft_overall_um_pp", "eccentricity_ratio"
OIL_C, GAP = "oil_temperature_c", "gap_um"
ZONES, REFERENCE = "zones.bearing_mm_s_rms", "order1_reference"
TABLE = "a_b = 1.0, b_c = 2.0, c_d = 3.0"
OTHER = "alert = 150.0, table = [{"
ONE_TABLE = "{{ table = [{{ a_b = {}, b_c = {}, c_d = {} }}] }}"
BETWEEN = "alert_below = 600.0, alert = 700.0"


@pytest.mark.parametrize(
    ("name", "value", "key", "said"),
    [
        (ORDER1, "{}", ".alert", "one of alert and danger must be given"),
        (ORDER1, "{ alert = 0.0 }", ".alert = 0.0", "greater than 0"),
        (ORDER1, "{ alert = 9.0, danger = 8.0 }", ".danger = 8.0", "must be above alert = 9"),
        (ORDER1, "{ alert = 9.0, deadband = 9.0 }", ".deadband = 9.0", "below the lowest limit, 9"),
        (ORDER1, "{ alert = 4.0 }", ".deadband (by default)", "must be below the lowest limit, 4"),
        (ORDER1, "{ alert = 9.0, on_delay_s = -1.0 }", ".on_delay_s = -1.0", "or equal to 0"),
        ("shaft_order1_um", "{ alert = 1.0 }", "", "known keys: bearing_order1_change_um_pk"),
        (OIL_C, "{ alert = 300.0 }", ".alert = 300.0", "200"),
        (SPAN, "{ danger = 0.0 }", ".danger = 0.0", "than 0"),
        (ECCENTRICITY, "{ alert = -0.7 }", ".alert = -0.7", "than 0"),
        (ECCENTRICITY, '{ alert = 1.0, states = ["x"] }', ".states[1] = 'x'", "'full_load'"),
        (ECCENTRICITY, "{ alert = 0.7, states = [] }", ".states", "least"),
        (ECCENTRICITY, '{ alert = 1.0, states = ["run_up", "run_up"] }', ".states[2]", "twice"),
        (ECCENTRICITY, "{ alert = 0.7, latching = 1 }", ".latching = 1", "boolean"),
        (GAP, "{ deadband = 1.0 }", ".alert", "alert_below and danger_below must be given"),
        (GAP, "{ alert_below = 600.0, danger_below = 700.0 }", ".alert_below", "below = 700"),
        (GAP, "{ alert_below = 600.0, alert = 500.0 }", ".alert = 500.0", "alert_below = 600"),
        (GAP, f"{{ {BETWEEN}, deadband = 50.0 }}", ".deadband = 50", "allowed range, 50 µm"),
        (ZONES, ONE_TABLE.format(2.0, 2.0, 3.0), ".table[1].b_c = 2.0", "a_b = 2"),
        (ZONES, ONE_TABLE.format(1.0, 2.0, 1.5), ".table[1].c_d = 1.5", "b_c = 2"),
        (ZONES, ONE_TABLE.format(0.0, 2.0, 3.0), ".table[1].a_b = 0.0", "than 0"),
        (ZONES, f"{{ table = [{{ {TABLE}, deadband = 2.0 }}] }}", ".table[1].deadband", "b_c = 2"),
        (ZONES, f"{{ table = [{{ {TABLE} }}, {{ {TABLE} }}] }}", ".table[2]", "of table[1]"),
        (ORDER1, f"{{ {OTHER} states = [] }}] }}", ".table[1].states", "least"),
        (ORDER1, f"{{ {OTHER} danger = 140.0 }}] }}", ".table[1].danger", "above alert = 150"),
        (ORDER1, f"{{ {OTHER} alert = -1.0 }}] }}", ".table[1].alert", "greater than 0"),
        (ORDER1, f"{{ {OTHER} alert_below = 9.0 }}] }}", ".table[1].alert_below", "not permitted"),
        (ORDER1, f"{{ {OTHER} attitude_deg = [-5, 9] }}] }}", ".table[1].attitude_deg", "0 to 360"),
        (
            ORDER1,
            f"{{ {OTHER} eccentricity_ratio = [0.4, 0.3] }}] }}",
            ".table[1].eccentricity_ratio",
            "must be [low, high] with low < high",
        ),
        (ORDER1, f"{{ {OTHER} }}, {{ states = ['full_load'] }}] }}", ".table[2]", "of table[1]"),
        (ZONES, "{ table = [] }", ".table", "at least 1"),
        ("zones.x", f"{{ table = [{{ {TABLE} }}] }}", "", "known keys: bearing_mm_s_rms, shaft"),
        (REFERENCE, "[{}]", "[1].shaft_x", "shaft_y, bearing_x, bearing_y must be given"),
        (REFERENCE, "[{ shaft_x = [-1.0] }]", "[1].shaft_x[1] = -1.0", "must be 0 to 5000"),
        (REFERENCE, "[{ shaft_x = [6.0, 400.0] }]", "[1].shaft_x[2] = 400.0", "be -360 to 360"),
        (REFERENCE, "[{ shaft_x = [6.0, 30.0] }]", "[1].shaft_x", "phase requires key_phase"),
        (REFERENCE, "[{ shaft_x = [6.0] }, { shaft_x = [5.0] }]", "[2].states[1]", "used twice"),
    ],
)
def test_limits_that_do_not_fit_are_named_with_what_is_allowed(
    changed, mistakes, name, value, key, said
):
    text, line = changed(OIL, f"{OIL}\nalarms.{name} = {value}")

    [mistake] = mistakes(text)

    assert mistake.startswith(f"{line + 1}: {UJB}{name}{key}"), mistake
    assert said in mistake


ROOT = Path(__file__).parents[3]
MAX_NAMED = 6
"""Kinds that one module may name because it judges them."""


def names_of(*classes: type) -> set[str]:
    return {field.name for each in classes for field in fields(each)}


def test_every_kind_names_a_rule_and_a_reading_that_exist(rules):
    readings = {quantity.name for quantity in CATALOGUE}
    readings |= {"shaft_x", "shaft_y", "bearing_x", "bearing_y"}
    for kind in units.ALARM_KINDS.values():
        assert kind.rule in {*rules(""), *names_of(UnitRules)}, kind.name
        assert kind.reading is None or kind.reading in readings, kind.name
    for kind in SERVICE_KINDS.values():
        assert kind.rule in service_rules_of(AlarmSettings()), kind.name
    parts = MagicMock()
    parts.bus.oldest_wait_s, parts.stream.behind_s = 0.0, 0.0
    assert set(Analysis.health(parts).readings) == {
        kind.reading for kind in SERVICE_KINDS.values()
    } - {None}
    assert len(ALARM_KINDS) == len(units.ALARM_KINDS) + len(SERVICE_KINDS)


@pytest.mark.parametrize("pattern", ["*.py", "*.js"])
def test_no_other_module_of_the_service_lists_kinds_of_alarms(pattern):
    other = {quantity.name for quantity in CATALOGUE} | names_of(Bearing)
    other |= service_rules_of(AlarmSettings()).keys()
    wanted = "|".join(ALARM_KINDS.keys() - other)
    for path in (ROOT / "service").rglob(pattern):
        if path.name != "alarm_kinds.py":
            named = re.findall(rf"(?<!\w)({wanted})(?!\w)", path.read_text())
            assert len(set(named)) <= MAX_NAMED, path
