"""Links and clocks that raise alarms; alarms after a restart, and of what is watched no more."""

from dataclasses import replace
from typing import Any

from rigs.alarm_runs import LINK, PROBE, T0, Make, changes, events, lost, play

from acquisition.errors import LinkError
from core.alarms.alarm import AlarmState
from core.alarms.operation import Acknowledge, Shelve
from core.samples.blocks import DeviceClock


async def test_after_a_restart_alarms_are_what_they_were_and_their_conditions_unknown(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    plant.alarms.operate(PROBE, Acknowledge("A. Name", 1))
    plant.alarms.operate("U1:sy:channel_not_ok", Shelve("A. Name", "known", T0 + 10**14))
    await plant.recorder.flush()

    plant.start_alarms()
    await plant.recorder.flush()

    alarm = plant.alarms.alarm(PROBE)
    assert alarm.state is AlarmState.ACKNOWLEDGED
    assert (alarm.condition.is_known, alarm.condition.reason) == (False, "restarted")
    assert plant.alarms.alarm("U1:sy:channel_not_ok").state is AlarmState.SHELVED
    assert changes(plant, PROBE) == ["raised", "acknowledged", "condition_unknown"]

    await play(plant, scripted, [lost(block(n)) for n in range(400, 404)])
    assert changes(plant, PROBE)[3:] == ["condition_known"]
    assert plant.alarms.alarm(PROBE).occurrence == 1  # announced once, not again


async def test_what_was_repaired_while_the_service_was_down_returns_with_the_first_good_samples(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    plant.start_alarms()

    await play(plant, scripted, [block(n) for n in range(400, 410)])

    assert changes(plant, PROBE) == ["raised", "condition_unknown", "condition_known", "returned"]


async def test_a_device_that_refuses_is_an_alarm_with_what_it_said(
    plant: Any, scripted: Make, block: Make
) -> None:
    refused = [[LinkError("10.0.0.7:502: Connection refused")] for _ in range(60)]

    await play(plant, scripted, [block(0), LinkError("reset by peer")], *refused, [block(1)])

    raised, returned, *_ = events(plant, alarm=LINK)
    assert (raised.change, raised.reason) == ("raised", "10.0.0.7:502: Connection refused")
    assert returned.change == "returned"
    assert 10.0 <= (raised.time_ns - T0) / 1e9 <= 10.6  # of the clock that passes while one waits


async def test_a_unit_that_never_answers_is_an_alarm_too(plant: Any) -> None:
    for seconds in (0.0, 5.0, 11.0):
        plant.clock.s = seconds
        plant.alarms.tick()
    await plant.recorder.flush()

    assert {event.identity.id for event in events(plant)} == {LINK, "U2:link:link_lost"}


async def test_a_device_whose_clock_is_off_is_an_alarm_by_the_hosts_clock(
    plant: Any, block: Make
) -> None:
    off = DeviceClock(offset_s=-5.0, drift_ppm=None, u_drift_ppm=None)
    for second in range(40):
        plant.clock.s = float(second)
        news = plant.alarms.take(replace(block(second), clock=off), [])
        if second < 30:
            assert news == []
    alarm = plant.alarms.alarm("U1:device:clock_offset")
    assert (alarm.level, alarm.condition.value, alarm.condition.limit) == (1, 5.0, 2.0)
    assert alarm.raised_ns == T0 + 30_000_000_000
