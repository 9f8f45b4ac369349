"""Limits and captures in the plant file: what fits is a rule, what does not is named."""

import tomllib
from collections.abc import Callable

import pytest

from core.alarms.alarm import AlarmRule
from core.alarms.limits import Limits
from core.alarms.rules import BearingRules, LimitRule
from core.alarms.state_limits import AT_SPEED, EVERY_STATE
from core.condition.operating_state import OperatingState
from service.alarms.rules import rules_of
from service.origin import Origin
from service.settings.plant import PlantFile
from service.wiring.captures import captures_of

Changed = Callable[[str, str], tuple[str, int]]
Mistakes = Callable[[str | bytes], list[str]]

SECOND = 1_000_000_000
EVERY_KNOWN_STATE = EVERY_STATE - {OperatingState.UNKNOWN}
UJB = "unit[1].bearing[1].alarms."
OIL = 'oil_temperature = "ujb_oil_temperature"'


@pytest.fixture
def plant_of(plant_text: str) -> Callable[..., PlantFile]:
    """Builds the demonstration plant with more keys for its first bearing, and more tables."""

    def build(bearing: str = "", tables: str = "") -> PlantFile:
        text = plant_text.replace(OIL, f"{OIL}\n{bearing}", 1)
        return PlantFile.model_validate(
            tomllib.loads(text.replace("[[unit]]", f"{tables}\n[[unit]]", 1))
        )

    return build


def test_without_limits_nothing_of_a_bearing_is_watched(plant_of: Callable[..., PlantFile]) -> None:
    plant = plant_of()

    rules = rules_of(plant.unit[0], plant.alarms, Origin.LIVE)

    assert set(rules.bearings.values()) == {BearingRules(None, None)}
    assert rules.channel == AlarmRule(SECOND // 2, 10 * SECOND)
    assert rules.link == AlarmRule(10 * SECOND, 0)
    assert rules.clock is not None
    assert rules.clock.offset.limits == Limits(2.0, deadband=0.2)


def test_limits_of_a_bearing_become_its_rules(plant_of: Callable[..., PlantFile]) -> None:
    plant = plant_of(
        "alarms.shaft_order1_um_pk = { alert = 150.0, danger = 250.0, on_delay_s = 0.0 }\n"
        "alarms.oil_temperature_c = { danger = 75.0, deadband = 2.0, off_delay_s = 1.5 }"
    )

    found = rules_of(plant.unit[0], plant.alarms, Origin.LIVE).bearings["UJB"]

    assert found.shaft_order1 == LimitRule(
        Limits(150.0, 250.0, 5.0), AlarmRule(0, 30 * SECOND), AT_SPEED
    )
    assert found.oil_temperature == LimitRule(
        Limits(None, 75.0, 2.0), AlarmRule(10 * SECOND, 3 * SECOND // 2), EVERY_KNOWN_STATE
    )


def test_a_replay_has_no_rules_for_link_and_clock_and_keeps_no_captures(
    plant_of: Callable[..., PlantFile],
) -> None:
    plant = plant_of()

    rules = rules_of(plant.unit[0], plant.alarms, Origin.REPLAY)

    assert (rules.link, rules.clock) == (None, None)
    assert captures_of(plant, Origin.REPLAY, None)._histories == {}  # type: ignore[arg-type]
    assert set(captures_of(plant, Origin.LIVE, None)._histories) == {"U1", "U2"}  # type: ignore[arg-type]


def test_clocks_and_captures_can_be_left_alone(plant_of: Callable[..., PlantFile]) -> None:
    plant = plant_of(tables='[alarms]\nclock = "ignored"\n[capture]\nsamples = "not_kept"')

    assert rules_of(plant.unit[0], plant.alarms, Origin.LIVE).clock is None
    assert captures_of(plant, Origin.LIVE, None)._histories == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("limits", "key", "said"),
    [
        ("shaft_order1_um_pk = {}", "shaft_order1_um_pk.alert", "gives no limit"),
        (
            "shaft_order1_um_pk = { alert = 0.0 }",
            "shaft_order1_um_pk.alert = 0.0",
            "greater than 0",
        ),
        ("shaft_order1_um_pk = { alert = -1.0 }", "shaft_order1_um_pk.alert = -1.0", "greater"),
        ("shaft_order1_um_pk = { alert = nan }", "shaft_order1_um_pk.alert = nan", "finite"),
        (
            "shaft_order1_um_pk = { alert = 250.0, danger = 150.0 }",
            "shaft_order1_um_pk.danger = 150.0",
            "must be above alert, 250",
        ),
        (
            "shaft_order1_um_pk = { alert = 150.0, deadband = 150.0 }",
            "shaft_order1_um_pk.deadband = 150.0",
            "must be below the lowest limit, 150",
        ),
        (
            "shaft_order1_um_pk = { alert = 4.0 }",
            "shaft_order1_um_pk.deadband (by default)",
            "must be below the lowest limit, 4",
        ),
        (
            "shaft_order1_um_pk = { alert = 150.0, on_delay_s = -1.0 }",
            "shaft_order1_um_pk.on_delay_s = -1.0",
            "greater than or equal to 0",
        ),
        (
            "shaft_order1_um = { alert = 1.0 }",
            "shaft_order1_um",
            "known here: bearing_order1_change_um_pk",
        ),
        ("oil_temperature_c = { alert = 300.0 }", "oil_temperature_c.alert = 300.0", "200"),
    ],
)
def test_limits_that_do_not_fit_are_named_with_what_is_allowed(
    changed: Changed, mistakes: Mistakes, limits: str, key: str, said: str
) -> None:
    text, line = changed(OIL, f"{OIL}\nalarms.{limits}")

    [mistake] = mistakes(text)

    assert mistake.startswith(f"{line + 1}: {UJB}{key}"), mistake
    assert said in mistake


def test_a_limit_of_an_oil_that_nobody_measures_is_refused(
    changed: Changed, mistakes: Mistakes
) -> None:
    text, _ = changed(OIL, "alarms.oil_temperature_c = { alert = 65.0 }")

    [mistake] = mistakes(text)

    assert f"{UJB}oil_temperature_c" in mistake
    assert "needs the bearing's oil_temperature" in mistake


@pytest.mark.parametrize(
    ("table", "key", "said"),
    [
        ("[capture]\nmax_s = 100.0", "capture.max_s = 100.0", "at least pre_s + post_s, 180"),
        ("[capture]\npre_s = 601.0", "capture.pre_s = 601.0", "600"),
        ("[capture]\nmax_gb = 0.0", "capture.max_gb = 0.0", "greater than 0"),
        ('[capture]\nsamples = "some"', "capture.samples = 'some'", "'kept' or 'not_kept'"),
        ("[alarms]\nlink_lost_after_s = 0.5", "alarms.link_lost_after_s = 0.5", "equal to 1"),
        ("[alarms]\nmax_clock_offset_s = 0.0", "alarms.max_clock_offset_s = 0.0", "than 0"),
        ('[alarms]\nclock = "off"', "alarms.clock = 'off'", "'judged' or 'ignored'"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(
    changed: Changed, mistakes: Mistakes, table: str, key: str, said: str
) -> None:
    text, _ = changed("[[unit]]", f"{table}\n\n[[unit]]")

    [mistake] = mistakes(text)

    assert key in mistake
    assert said in mistake
