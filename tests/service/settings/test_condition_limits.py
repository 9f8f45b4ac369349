"""Limits by operating state, zones, gaps and vector references in the plant file."""

import tomllib
from collections.abc import Callable

import pytest

from core.alarms.alarm import AlarmLevel
from core.alarms.chatter import ChatterRule
from core.alarms.limits import Limits
from core.alarms.rules import BearingRules, LimitRule
from core.alarms.state_limits import AT_SPEED
from core.alarms.vector_change import OrderVector, VectorReference
from core.condition.operating_state import OperatingState
from service.alarms.rules import chatter_rule_of, references_of, rules_of
from service.origin import Origin
from service.settings.plant import PlantFile

Changed = Callable[[str, str], tuple[str, int]]
Mistakes = Callable[[str | bytes], list[str]]
PlantOf = Callable[..., PlantFile]

SECOND = 1_000_000_000
UJB = "unit[1].bearing[1].alarms."
OIL = 'oil_temperature = "ujb_oil_temperature"'
ALERT, DANGER = AlarmLevel


@pytest.fixture
def plant_of(plant_text: str) -> PlantOf:
    def build(bearing: str = "", tables: str = "") -> PlantFile:
        text = plant_text.replace(OIL, f"{OIL}\n{bearing}", 1)
        return PlantFile.model_validate(
            tomllib.loads(text.replace("[[unit]]", f"{tables}\n[[unit]]", 1))
        )

    return build


def rules(plant: PlantFile) -> BearingRules:
    return rules_of(plant.unit[0], plant.alarms, Origin.LIVE).bearings["UJB"]


def test_a_limit_counts_in_the_states_it_names_and_may_latch(plant_of: PlantOf) -> None:
    found = rules(
        plant_of(
            "alarms.shaft_overall_um_pp = { alert = 300.0,"
            ' states = ["part_load", "run_down"], latching = true }'
        )
    ).shaft_overall

    assert found is not None
    assert found.states == {OperatingState.PART_LOAD, OperatingState.RUN_DOWN}
    assert found.rule.is_latching


def test_limits_of_vibration_count_at_speed_unless_said_otherwise(plant_of: PlantOf) -> None:
    found = rules(
        plant_of(
            "alarms.bearing_overall_mm_s_rms = { alert = 2.0 }\n"
            "alarms.eccentricity_ratio = { danger = 0.9 }\n"
            "alarms.shaft_order1_change_um_pk = { alert = 30.0 }"
        )
    )

    for rule in (found.bearing_overall, found.eccentricity, found.shaft_change):
        assert isinstance(rule, LimitRule)
        assert rule.states == AT_SPEED
        assert not rule.rule.is_latching


def test_a_gap_has_limits_on_both_sides(plant_of: PlantOf) -> None:
    found = rules(
        plant_of(
            "alarms.gap_um = { danger_below = 400.0, alert_below = 600.0,"
            " alert = 2400.0, danger = 2600.0 }"
        )
    ).gap

    assert found is not None
    assert found.limits == Limits(2400.0, 2600.0, 10.0, 600.0, 400.0)


def test_zones_differ_from_state_to_state(plant_of: PlantOf) -> None:
    found = rules(
        plant_of(
            "alarms.zones.shaft_um_pp = { off_delay_s = 5.0, table = [\n"
            '  { states = ["full_load"], a_b = 100.0, b_c = 200.0, c_d = 300.0 },\n'
            '  { states = ["part_load"], a_b = 150.0, b_c = 250.0, c_d = 400.0, deadband = 1.0 }] }'
        )
    ).shaft_zones

    assert found is not None
    full = found.by_state.at(OperatingState.FULL_LOAD)
    part = found.by_state.at(OperatingState.PART_LOAD)
    assert full is not None
    assert part is not None
    assert (full.alert, full.danger, full.deadband) == (200.0, 300.0, 5.0)
    assert (part.alert, part.danger, part.deadband) == (250.0, 400.0, 1.0)
    assert found.by_state.at(OperatingState.SPEED_NO_LOAD) is None
    assert found.rule.off_delay_ns == 5 * SECOND


def test_a_reference_holds_in_each_state_it_names(plant_of: PlantOf) -> None:
    found = references_of(
        plant_of(
            "alarms.order1_reference = ["
            ' { states = ["part_load", "full_load"], shaft_x = [60.0], bearing_y = [20.0] }]'
        ).unit[0]
    )

    vectors = {"shaft_x": OrderVector(60.0), "bearing_y": OrderVector(20.0)}
    assert sorted(found, key=lambda r: r.state) == [
        VectorReference("U1", "UJB", state, vectors)
        for state in (OperatingState.PART_LOAD, OperatingState.FULL_LOAD)
    ]


def test_what_counts_as_chattering_is_three_in_a_minute_unless_said_otherwise(
    plant_of: PlantOf,
) -> None:
    other = "[alarms]\nchattering_activations = 5\nchattering_window_s = 600.0"

    assert chatter_rule_of(plant_of().alarms) == ChatterRule(3, 60 * SECOND)
    assert chatter_rule_of(plant_of(tables=other).alarms) == ChatterRule(5, 600 * SECOND)


TABLE = "a_b = 1.0, b_c = 2.0, c_d = 3.0"


@pytest.mark.parametrize(
    ("limits", "key", "said"),
    [
        ("shaft_overall_um_pp = { alert = nan }", "shaft_overall_um_pp.alert = nan", "finite"),
        ("shaft_overall_um_pp = { danger = 0.0 }", "shaft_overall_um_pp.danger = 0.0", "than 0"),
        (
            "bearing_overall_mm_s_rms = { alert = 4.0, danger = 2.0 }",
            "bearing_overall_mm_s_rms.danger = 2.0",
            "must be above alert, 4",
        ),
        (
            "eccentricity_ratio = { alert = 0.7, deadband = 0.8 }",
            "eccentricity_ratio.deadband = 0.8",
            "must be below the lowest limit, 0.7",
        ),
        ("eccentricity_ratio = { alert = -0.7 }", "eccentricity_ratio.alert = -0.7", "than 0"),
        (
            'eccentricity_ratio = { alert = 0.7, states = ["cruising"] }',
            "eccentricity_ratio.states[1] = 'cruising'",
            "'full_load'",
        ),
        ("eccentricity_ratio = { alert = 0.7, states = [] }", "eccentricity_ratio.states", "least"),
        (
            'eccentricity_ratio = { alert = 0.7, states = ["run_up", "run_up"] }',
            "eccentricity_ratio.states[2] = 'run_up'",
            "used twice",
        ),
        (
            "eccentricity_ratio = { alert = 0.7, latching = 1 }",
            "eccentricity_ratio.latching = 1",
            "boolean",
        ),
        ("gap_um = { deadband = 1.0 }", "gap_um.alert", "alert_below or danger_below"),
        (
            "gap_um = { alert_below = 600.0, danger_below = 700.0 }",
            "gap_um.alert_below = 600.0",
            "must be above danger_below, 700",
        ),
        (
            "gap_um = { alert_below = 600.0, alert = 500.0 }",
            "gap_um.alert = 500.0",
            "must be above alert_below, 600",
        ),
        (
            "gap_um = { alert_below = 600.0, alert = 700.0, deadband = 50.0 }",
            "gap_um.deadband = 50.0",
            "must be below half the room between, 50",
        ),
        (
            "zones.bearing_mm_s_rms = { table = [{ a_b = 2.0, b_c = 2.0, c_d = 3.0 }] }",
            "zones.bearing_mm_s_rms.table[1].b_c = 2.0",
            "must be above a_b, 2",
        ),
        (
            "zones.bearing_mm_s_rms = { table = [{ a_b = 1.0, b_c = 2.0, c_d = 1.5 }] }",
            "zones.bearing_mm_s_rms.table[1].c_d = 1.5",
            "must be above b_c, 2",
        ),
        (
            "zones.bearing_mm_s_rms = { table = [{ a_b = 0.0, b_c = 2.0, c_d = 3.0 }] }",
            "zones.bearing_mm_s_rms.table[1].a_b = 0.0",
            "than 0",
        ),
        (
            f"zones.bearing_mm_s_rms = {{ table = [{{ {TABLE}, deadband = 2.0 }}] }}",
            "zones.bearing_mm_s_rms.table[1].deadband = 2.0",
            "must be below b_c, 2",
        ),
        (
            f"zones.bearing_mm_s_rms = {{ table = [{{ {TABLE} }}, {{ {TABLE} }}] }}",
            "zones.bearing_mm_s_rms.table[2].states[1]",
            "used twice",
        ),
        ("zones.bearing_mm_s_rms = { table = [] }", "zones.bearing_mm_s_rms.table", "at least 1"),
        (
            f"zones.bearing_in_s = {{ table = [{{ {TABLE} }}] }}",
            "zones.bearing_in_s",
            "known here: bearing_mm_s_rms, shaft_max_um_pk, shaft_um_pp",
        ),
        ("order1_reference = [{}]", "order1_reference[1].shaft_x", "gives no vector"),
        (
            "order1_reference = [{ shaft_x = [-1.0] }]",
            "order1_reference[1].shaft_x[1] = -1.0",
            "amplitude must be 0 to 5000",
        ),
        (
            "order1_reference = [{ shaft_x = [60.0, 400.0] }]",
            "order1_reference[1].shaft_x[2] = 400.0",
            "phase must be -360 to 360",
        ),
        (
            "order1_reference = [{ shaft_x = [60.0, 30.0] }]",
            "order1_reference[1].shaft_x",
            "needs the unit's key_phase",
        ),
        (
            "order1_reference = [{ shaft_x = [60.0] }, { shaft_x = [50.0] }]",
            "order1_reference[2].states[1]",
            "used twice",
        ),
    ],
)
def test_what_does_not_fit_is_named_with_what_is_allowed(
    changed: Changed, mistakes: Mistakes, limits: str, key: str, said: str
) -> None:
    text, line = changed(OIL, f"{OIL}\nalarms.{limits}")

    [mistake] = mistakes(text)

    assert mistake.startswith(f"{line + 1}: {UJB}{key}"), mistake
    assert said in mistake


def test_no_unit_is_called_as_alarms_of_the_whole_plant_are(
    changed: Changed, mistakes: Mistakes
) -> None:
    text, _ = changed('id = "U1"', 'id = "plant"')

    assert "kept for alarms of the whole plant" in mistakes(text)[0]


@pytest.mark.parametrize(
    ("table", "key", "said"),
    [
        ("chattering_activations = 1", "alarms.chattering_activations = 1", "equal to 2"),
        ("chattering_window_s = 0.0", "alarms.chattering_window_s = 0.0", "equal to 1"),
        ("max_waiting_share = 1.0", "alarms.max_waiting_share = 1.0", "less than 1"),
        ("max_samples_lost_share = 0.0", "alarms.max_samples_lost_share = 0.0", "than 0"),
        ("store_failing_after_s = -1.0", "alarms.store_failing_after_s = -1.0", "equal to 0"),
    ],
)
def test_limits_of_the_service_itself_are_checked(
    changed: Changed, mistakes: Mistakes, table: str, key: str, said: str
) -> None:
    text, _ = changed("[[unit]]", f"[alarms]\n{table}\n\n[[unit]]")

    [mistake] = mistakes(text)

    assert key in mistake
    assert said in mistake
