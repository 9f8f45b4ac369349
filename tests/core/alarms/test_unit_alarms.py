"""All alarms of one unit, fed with blocks."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from core.alarms.alarm import AlarmState
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import AlarmLevel, Limits
from core.machine.channel import SlowChannel
from core.machine.unit import Unit
from core.quality import GOOD, Reading, Reason, bad, missing, uncertain
from core.samples.blocks import StampFault

SECOND = 1_000_000_000
IDS = ("sx", "sy", "bx", "by", "spare")

RULES = UnitRules(
    channel=rule_of(0.0, 0.0),
    slow_channel=rule_of(0.0, 0.0),
    bearings={
        "UJB": {
            "shaft_order1": LimitRule(Limits(60.0, 90.0), rule_of(0.0, 0.0)),
            "oil_temperature": LimitRule(Limits(65.0, 75.0, 1.0), rule_of(2.0, 2.0)),
        }
    },
)


def assessed(**readings: Reading) -> Any:
    """As much of an assessment as alarms look at; 30 µm everywhere unless said."""
    places = ("shaft_x", "shaft_y", "bearing_x", "bearing_y")
    all_: Mapping[str, Reading] = {f"order1_{p}_um_pk": Reading(30.0) for p in places} | {
        f"order1_{name}_um_pk": reading for name, reading in readings.items()
    }
    return SimpleNamespace(
        unit="U1",
        bearing="UJB",
        time_ns=5 * SECOND,
        readings=all_,
        condition=None,
        clipped_share={"shaft_x": 0.04},
        recent=(),
    )


def told(news: Sequence[Any]) -> list[tuple[str, str]]:
    return [(e.identity.id, e.change.value) for each in news for e in each.events]


@pytest.fixture
def alarms(unit: Unit) -> UnitAlarms:
    return UnitAlarms(unit, RULES)


def test_each_part_of_a_unit_has_its_alarm_by_a_name_that_stays(alarms):
    assert [alarm.identity.id for alarm in alarms.alarms] == [
        *(f"U1:{id_}:channel_not_ok" for id_ in (*IDS, "oil")),
        "U1:UJB:order1_shaft_x",
        "U1:UJB:order1_shaft_y",
        "U1:UJB:oil_temperature",
        "U1:device:clock_offset",
        "U1:device:clock_drift",
        "U1:device:time_stamps",
        "U1:link:link_lost",
    ]


def test_a_replay_judges_neither_link_nor_clock(unit, block):
    clock = dict.fromkeys(("clock_offset", "clock_drift", "time_stamps"))
    alarms = UnitAlarms(unit, replace(RULES, **clock, link=None))
    alarms.link(False, "played out", 0)
    alarms.tick(10**15)
    alarms.take(block(0, stamp_fault=StampFault.JUMPED), [], 10**15)

    assert {a.identity.kind for a in alarms.alarms} == {
        "channel_not_ok",
        "order1_shaft_x",
        "order1_shaft_y",
        "oil_temperature",
    }
    assert all(a.state is AlarmState.NORMAL for a in alarms.alarms)


def test_a_channel_without_a_bearing_is_watched_too(alarms, block):
    news = alarms.take(block(0, qualities=(*(GOOD,) * 4, bad(Reason.CLIPPED))), [], 0)

    assert told(news) == [("U1:spare:channel_not_ok", "raised")]
    assert news[0].events[0].time_ns == SECOND  # the end of the block that shows it


def test_a_probe_that_one_segment_shows_as_stuck_is_an_alarm_until_one_does_not(alarms, block):
    stuck = assessed(shaft_x=missing(Reason.STUCK))
    alarms.take(block(0), [], 0)
    first = alarms.take(block(1), [stuck], 0)
    nothing = alarms.take(block(2), [assessed(shaft_x=missing(Reason.STANDSTILL))], 0)
    last = alarms.take(block(3), [assessed()], 0)

    assert ("U1:sx:channel_not_ok", "raised") in told(first)
    assert ("U1:sx:channel_not_ok", "returned") not in told(nothing)
    assert ("U1:sx:channel_not_ok", "returned") in told(last)


def test_a_channel_that_clips_too_often_says_how_often(alarms, block):
    alarms.take(block(0), [], 0)
    few = alarms.take(block(1), [assessed(shaft_x=Reading(30.0, uncertain(Reason.CLIPPED)))], 0)
    [news] = alarms.take(block(2), [assessed(shaft_x=missing(Reason.CLIPPED))], 0)

    assert few == []
    assert told([news]) == [("U1:sx:channel_not_ok", "raised")]
    assert (news.events[0].reason, news.events[0].value, news.events[0].limit) == ("clipped", 4, 1)


def test_a_film_of_the_wrong_sign_is_an_alarm_of_both_channels_until_it_is_right(alarms, block):
    def with_k(**readings: Reading) -> Any:
        found = assessed()
        found.readings |= {f"{name}_xx_n_per_m": r for name, r in readings.items()}
        return found

    reversed_ = with_k(dynamic_k=missing(Reason.POLARITY), order1_transfer_k=Reading(1e9))
    right = with_k(dynamic_k=Reading(1e9), order1_transfer_k=missing(Reason.POLARITY))
    alarms.take(block(0), [], 0)
    first = alarms.take(block(1), [reversed_], 0)
    weak = alarms.take(block(2), [assessed()], 0)
    last = alarms.take(block(3), [right], 0)

    channels = [f"U1:{id_}:channel_not_ok" for id_ in ("sx", "bx")]
    assert [(id_, "raised") for id_ in channels] == [e for e in told(first) if "channel" in e[0]]
    assert {news.events[0].reason for news in first[-2:]} == {"polarity"}
    assert weak == []
    assert [(id_, "returned") for id_ in channels] == [e for e in told(last) if "channel" in e[0]]


def test_an_amplitude_is_judged_when_its_segment_ends_not_when_the_block_does(alarms, block):
    [news] = alarms.take(block(7), [assessed(shaft_y=Reading(61.0))], 0)

    assert told([news]) == [("U1:UJB:order1_shaft_y", "raised")]
    assert news.events[0].time_ns == 5 * SECOND


def test_warm_oil_is_an_alert_after_its_delay_and_hot_oil_a_danger(alarms, block):
    warm, hot = Reading(66.0), Reading(76.0)
    found = [told(alarms.take(block(s, oil=warm), [], 0)) for s in range(4)]
    found += [told(alarms.take(block(s, oil=hot), [], 0)) for s in range(4, 8)]

    id_ = "U1:UJB:oil_temperature"
    assert found == [[], [], [(id_, "raised")], [], [], [], [(id_, "escalated")], []]


def test_a_slow_quantity_has_the_alarm_of_its_kind_and_one_of_its_thermometer(unit, block):
    pad = SlowChannel("pad", "pad_temperature", "UJB", "3")
    rules = replace(
        RULES,
        bearings={"UJB": {"pad_temperatures": LimitRule(Limits(8.0), rule_of(0.0, 0.0))}},
        slow_limits={"pad": LimitRule(Limits(80.0, alert_below=10.0), rule_of(0.0, 0.0))},
    )
    alarms = UnitAlarms(replace(unit, slow_channels=(pad,)), rules)
    hot, cold = (block(n, slow={"pad": Reading(value)}) for n, value in ((1, 81.0), (2, 9.0)))
    assert told(alarms.take(hot, [], 0)) == [("U1:pad:pad_temperature", "raised")]
    assert alarms.alarm("U1:pad:pad_temperature").condition.limit == 80.0
    alarms.take(cold, [], 0)
    assert alarms.alarm("U1:pad:pad_temperature").condition.reason == "below_limit"
    broken = block(3, slow={"pad": missing(Reason.OUT_OF_RANGE)})
    assert ("U1:pad:channel_not_ok", "raised") in told(alarms.take(broken, [], 0))
    uneven = assessed()
    uneven.readings["pad_temperature_excess_k"] = Reading(9.0)
    assert ("U1:UJB:pad_temperature_excess", "raised") in told(alarms.take(block(4), [uneven], 0))


def test_a_broken_thermometer_is_said_and_clears_no_hot_oil(alarms, block):
    for second in range(4):
        alarms.take(block(second, oil=Reading(76.0)), [], 0)

    news = alarms.take(block(4, oil=missing(Reason.OUT_OF_RANGE)), [], 0)
    for second in range(5, 100):
        alarms.take(block(second, oil=missing(Reason.OUT_OF_RANGE)), [], 0)

    assert sorted(told(news)) == [
        ("U1:UJB:oil_temperature", "condition_unknown"),
        ("U1:oil:channel_not_ok", "raised"),
    ]
    assert alarms.alarm("U1:UJB:oil_temperature").level is AlarmLevel.DANGER


def test_a_block_that_comes_again_decides_nothing(alarms, block):
    for second in range(3):
        alarms.take(block(second), [], 0)

    clipped = (bad(Reason.CLIPPED),) * 5
    assert alarms.take(block(1, qualities=clipped), [], 0) == []
    assert told(alarms.take(block(3, qualities=clipped), [], 0)) != []


def test_a_channel_whose_rows_are_amplitude_and_phase_fails_with_either(unit, block):
    rows = ["sx", "sx", "sy", "sy", "bx", "bx", "by", "by"]
    alarms = UnitAlarms(unit, RULES, rows)
    phase_lost = [GOOD, bad(Reason.NOT_FINITE), *(GOOD,) * 6]

    news = alarms.take(block(0, qualities=phase_lost), [], 0)

    assert told(news) == [("U1:sx:channel_not_ok", "raised")]
    spare = alarms.alarm("U1:spare:channel_not_ok")  # no row is about it
    assert (spare.condition.is_known, spare.condition.reason) == (False, "not_measured")


def test_stamps_that_do_not_fit_are_an_alarm_that_lasts_a_while(alarms, block):
    news = alarms.take(block(0, stamp_fault=StampFault.REGRESSED), [], 0)
    alarms.take(block(1), [], 0)
    later = alarms.take(block(2), [], 599 * SECOND)
    at_last = alarms.take(block(3), [], 600 * SECOND)

    assert told(news) == [("U1:device:time_stamps", "raised")]
    assert news[0].events[0].reason == "stamp_regressed"
    assert (told(later), told(at_last)) == ([], [("U1:device:time_stamps", "returned")])


def test_nothing_is_said_of_a_unit_in_good_health(alarms, block):
    alarms.link(True, None, 0)
    news = [alarms.take(block(s), [assessed()] if s % 9 == 8 else [], 0) for s in range(200)]

    assert not any(news)
    judged = [a for a in alarms.alarms if a.identity.subject != "device"]
    assert all(alarm.is_settled_inactive for alarm in judged)
