"""`UnitAlarms`: all alarms of one unit, and what samples, results, links and people do to them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from core.alarms.alarm import Alarm, AlarmKind, AlarmRule, Condition, unknown
from core.alarms.conditions import (
    SENSOR_FAULTS,
    channel_condition,
    drift_reading,
    link_condition,
    offset_reading,
    slow_channel_condition,
    stamp_condition,
)
from core.alarms.event import AlarmEvent, AlarmNews
from core.alarms.life_cycle import advance, interrupted, restored
from core.alarms.limits import judge
from core.alarms.operation import Action, expire, operate
from core.alarms.rules import UnitRules
from core.alarms.watch_list import LimitWatch, Watch, watch_list
from core.assessment import Assessment
from core.blocks import SampleBlock
from core.line_results import AMPLITUDES
from core.machine import Unit
from core.quality import Quality, Reading, Reason, missing, worst

NOT_THERE = missing(Reason.NOT_MEASURED)

RESTARTED, NO_LONGER_WATCHED = "restarted", "no_longer_watched"


class UnitAlarms:
    """Owns the alarms of one unit. Events come in the order in which things happened.

    Parameters
    ----------
    rules
        What is watched; alarms whose rule is gone can only be acknowledged.
    rows
        Which channel each row of a block is about, by id; the unit's channels if not given.
    """

    def __init__(self, unit: Unit, rules: UnitRules, rows: Sequence[str] | None = None) -> None:
        self._watched = watch_list(unit, rules)
        self._rules = {watch.id: watch.rule for watch in self._watched.all}
        self._alarms = {watch.id: Alarm(watch.identity) for watch in self._watched.all}
        of_rows = [channel.id for channel in unit.channels] if rows is None else list(rows)
        self._rows_of = {
            watch.source: [row for row, channel in enumerate(of_rows) if channel == watch.source]
            for watch in self._watched.channels
        }
        self._channels_of = {bearing.id: bearing.channels for bearing in unit.bearings}
        self._segment_faults: dict[str, Reason] = {}
        self._stop: tuple[int, int] | None = None
        self._resting_with: tuple[Quality, ...] | None = None
        self._link: tuple[bool, str | None] = (False, None)
        self._news: list[AlarmNews] = []

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return list(self._alarms.values())

    @property
    def is_connected(self) -> bool:
        """Whether samples arrive, by what was said last."""
        return self._link[0]

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if the unit has no such alarm."""
        return self._alarms[id_]

    def take(
        self, block: SampleBlock, assessments: Iterable[Assessment], host_ns: int
    ) -> list[AlarmNews]:
        """Take in a block and what has been learnt by it.

        Parameters
        ----------
        host_ns
            The host's time, by which the device's clock is judged.
        """
        if self._is_repeated(block):
            return []
        for assessment in assessments:
            self._take_assessment(assessment)
        self._take_channels(block)
        for watch in self._watched.slow_channels:
            reading = block.slow.get(watch.source, NOT_THERE)
            self._apply(watch, slow_channel_condition(reading), block.stop_ns)
        for warmth in self._watched.temperatures:
            self._compare(warmth, block.slow.get(warmth.source, NOT_THERE), block.stop_ns)
        self._take_clock(block, host_ns)
        return self._told()

    def films(self, conditions: Mapping[str, Condition], now_ns: int) -> list[AlarmNews]:
        """Take in what was decided about films.

        Parameters
        ----------
        conditions
            By alarm.
        now_ns
            Time of the samples that it was decided by.

        Raises
        ------
        KeyError
            If the unit has no such alarm about a film.
        """
        films = {watch.id: watch for watch in self._watched.films}
        for id_, condition in conditions.items():
            self._apply(films[id_], condition, now_ns)
        return self._told()

    def link(self, is_connected: bool, reason: str | None, host_ns: int) -> list[AlarmNews]:
        """Note whether samples arrive."""
        self._link = (is_connected, reason)
        self._take_link(host_ns)
        return self._told()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Let the host's time pass for a lost link and for what is shelved."""
        self._take_link(host_ns)
        for id_, alarm in self._alarms.items():
            if alarm.shelf is not None:
                self._note(id_, *expire(alarm, host_ns))
        return self._told()

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Do what somebody asks for.

        Raises
        ------
        KeyError
            If the unit has no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        """
        self._note(id_, *operate(self._alarms[id_], action, host_ns))
        return self._told()

    def restore(self, alarms: Iterable[Alarm], host_ns: int) -> list[AlarmNews]:
        """Go on where the service stopped: what was active is, and its condition is unknown.

        An alarm that nothing watches any more returns; it stays on the list until acknowledged.
        """
        for stored in alarms:
            id_ = stored.identity.id
            if id_ in self._rules:
                self._alarms[id_] = restored(stored)
                if stored.identity.kind is not AlarmKind.LINK_LOST:
                    self._advance(id_, unknown(RESTARTED, stored.suppressed_by), host_ns)
            elif stored.level is not None or not stored.is_acknowledged:
                self._alarms[id_] = restored(replace(stored, is_latched=False))
                self._rules[id_] = AlarmRule()
                self._advance(id_, Condition(reason=NO_LONGER_WATCHED), host_ns)
        return self._told()

    def _is_repeated(self, block: SampleBlock) -> bool:
        """Whether the block brings nothing new; where samples are missing, delays stand still."""
        before, self._stop = self._stop, (block.epoch, block.stop_index)
        if before is None or (block.epoch, block.first_index) == before:
            return False
        if block.epoch == before[0] and block.stop_index <= before[1]:
            self._stop = before
            return True
        if block.epoch != before[0] or block.first_index > before[1]:
            self._alarms = {
                id_: alarm if alarm.identity.kind is AlarmKind.LINK_LOST else interrupted(alarm)
                for id_, alarm in self._alarms.items()
            }
        return False

    def _take_assessment(self, assessment: Assessment) -> None:
        channels = self._channels_of[assessment.bearing]
        for channel, place in zip(channels, AMPLITUDES, strict=True):
            self._note_segment(channel, assessment.readings[f"order1_{place}_um_pk"])
        for watch in self._watched.amplitudes[assessment.bearing]:
            self._compare(watch, assessment.readings[watch.source], assessment.time_ns)

    def _note_segment(self, channel: str, reading: Reading) -> None:
        """Remember what only a segment shows of a channel, until another one shows otherwise."""
        if reading.quality.reason in SENSOR_FAULTS:
            self._resting_with = None
            self._segment_faults[channel] = reading.quality.reason
        elif reading.value is not None:
            self._segment_faults.pop(channel, None)

    def _take_channels(self, block: SampleBlock) -> None:
        """Judge every channel; where all rest and nothing is new, that is a single comparison."""
        if block.channel_quality == self._resting_with:
            return
        for watch in self._watched.channels:
            self._apply(watch, self._channel_condition(watch.source, block), block.stop_ns)
        resting = all(self._alarms[watch.id].is_resting for watch in self._watched.channels)
        self._resting_with = block.channel_quality if resting else None

    def _channel_condition(self, channel: str, block: SampleBlock) -> Condition:
        rows = self._rows_of[channel]
        if not rows:
            return unknown(Reason.NOT_MEASURED)
        quality = worst(block.channel_quality[row] for row in rows)
        return channel_condition(quality, self._segment_faults.get(channel))

    def _take_clock(self, block: SampleBlock, host_ns: int) -> None:
        offset, drift, stamps = self._watched.offset, self._watched.drift, self._watched.stamps
        if offset is not None:
            self._compare(offset, offset_reading(block.clock), host_ns)
        if drift is not None:
            self._compare(drift, drift_reading(block.clock), host_ns)
        if stamps is not None:
            self._apply(stamps, stamp_condition(block.stamp_fault), host_ns)

    def _take_link(self, host_ns: int) -> None:
        if self._watched.link is not None:
            self._apply(self._watched.link, link_condition(*self._link), host_ns)

    def _compare(self, watch: LimitWatch, reading: Reading, now_ns: int) -> None:
        alarm, value = self._alarms[watch.id], reading.value
        if alarm.is_resting and value is not None and value <= watch.limits.lowest:
            return  # as nearly always
        self._apply(watch, judge(reading, watch.limits, alarm.condition.level), now_ns)

    def _apply(self, watch: Watch, condition: Condition, now_ns: int) -> None:
        alarm = self._alarms[watch.id]
        if condition.level is None and condition.is_known and alarm.is_resting:
            return
        self._advance(watch.id, condition, now_ns)

    def _advance(self, id_: str, condition: Condition, now_ns: int) -> None:
        self._note(id_, *advance(self._alarms[id_], condition, now_ns, self._rules[id_]))

    def _note(self, id_: str, alarm: Alarm, events: tuple[AlarmEvent, ...]) -> None:
        self._alarms[id_] = alarm
        if events:
            self._news.append(AlarmNews(alarm, events))

    def _told(self) -> list[AlarmNews]:
        news, self._news = self._news, []
        return news
