"""`UnitAlarms`: all alarms of one unit, and what samples, results, links and people do to them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from core.alarms.alarm import Alarm
from core.alarms.board import AlarmBoard, AlarmMemory
from core.alarms.condition_limits import point_of, worst_of
from core.alarms.event import AlarmNews
from core.alarms.kinds import (
    DEVICE,
    SENSOR_FAULTS,
    LimitWatch,
    Watch,
    channel_condition,
    drift_reading,
    link_condition,
    offset_reading,
    slow_channel_condition,
    stamp_condition,
    watch_list,
)
from core.alarms.operation import Action
from core.alarms.rules import UnitRules
from core.alarms.vector_change import VectorReference, vector_condition
from core.condition.cells import NOWHERE_KNOWN, OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import Condition, unknown
from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from core.quality import Quality, Reading, Reason, missing, worst
from core.samples.blocks import SampleBlock
from core.stiffness.estimators import is_reversed
from core.stiffness.order_line import AMPLITUDES, DIRECTIONS
from core.units import NS_PER_S

NOT_THERE = missing(Reason.NOT_MEASURED)

POINT_HOLDS_NS = 300 * NS_PER_S
"""For how long a result's operating condition is taken for that of what no result is, too."""


class UnitAlarms:
    """Owns the alarms of one unit. Events come in the order in which things happened.

    Parameters
    ----------
    rules
        What is watched; alarms whose rule is gone can only be acknowledged.
    rows
        Which channel each row of a block is about, by id; the unit's channels if not given.
    references
        Vectors that 1× is compared with.
    """

    def __init__(
        self,
        unit: Unit,
        rules: UnitRules,
        rows: Sequence[str] | None = None,
        references: Iterable[VectorReference] = (),
    ) -> None:
        self._watched = watch_list(unit, rules)
        self._board = AlarmBoard(self._watched.all)
        of_rows = [channel.id for channel in unit.channels] if rows is None else list(rows)
        self._rows_of = {
            watch.source: [row for row, channel in enumerate(of_rows) if channel == watch.source]
            for watch in self._watched.channels
        }
        self._channels_of = {bearing.id: bearing.channels for bearing in unit.bearings}
        self._bearing_of = {
            id_: bearing.id for bearing in unit.bearings for id_ in bearing.channels
        }
        self._references = {(r.bearing, r.state): r for r in references}
        self._segment_faults: dict[str, Reason] = {}
        self._clipped_percent: dict[str, float] = {}
        self._points: dict[str, tuple[OperatingPoint, int]] = {}
        self._stop: tuple[int, int] | None = None
        self._resting_with: tuple[Quality, ...] | None = None
        self._link: tuple[bool, str | None] = (False, None)

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return self._board.alarms

    @property
    def is_connected(self) -> bool:
        """Whether samples arrive, by what was said last."""
        return self._link[0]

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if the unit has no such alarm."""
        return self._board.alarm(id_)

    def reference(self, bearing: str, state: OperatingState) -> VectorReference | None:
        """What the 1× vectors of a bearing are compared with in a state."""
        return self._references.get((bearing, state))

    def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a new reference from the next result on."""
        self._references[reference.bearing, reference.state] = reference

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
            self._find(watch, slow_channel_condition(reading), block.stop_ns)
        for warmth in self._watched.temperatures:
            reading = block.slow.get(warmth.source, NOT_THERE)
            point = self._recent_point(warmth.identity.subject, block.stop_ns)
            self._compare(warmth, reading, block.stop_ns, point)
        self._take_clock(block, host_ns)
        return self._board.told()

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
            point = self._recent_point(films[id_].source, now_ns)
            self._board.advance(films[id_].id, _at(point, condition), now_ns)
        return self._board.told()

    def link(self, is_connected: bool, reason: str | None, host_ns: int) -> list[AlarmNews]:
        """Note whether samples arrive."""
        self._link = (is_connected, reason)
        self._take_link(host_ns)
        return self._board.told()

    def pause(self) -> None:
        """Let all delays stand still up to now."""
        self._board.pause()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Let the host's time pass for a lost link and for what is shelved."""
        self._take_link(host_ns)
        self._board.expire(host_ns)
        return self._board.told()

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Do what somebody asks for.

        Raises
        ------
        KeyError
            If the unit has no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        """
        self._board.operate(id_, action, host_ns)
        return self._board.told()

    def restore(
        self, alarms: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Go on where the service stopped: what was active is, and its condition is unknown.

        An alarm that nothing watches any more returns; it stays on the list until acknowledged.

        Parameters
        ----------
        memory
            Where it is known what was known then, and nothing is missing since: then all conditions
            and delays go on.
        """
        stored = list(alarms)
        # what nothing watches any more is no less gone for having been known to the last
        kept = [a for a in memory.alarms if a.identity.id in self._board] if memory else []
        known = {alarm.identity.id for alarm in kept}
        self._board.restore((a for a in stored if a.identity.id not in known), host_ns)
        self._board.resume(kept, stored)
        if memory is not None:
            self._resume(memory)
        return self._board.told()

    @property
    def memory(self) -> AlarmMemory:
        """What must be known, beside the events of alarms, to go on from here elsewhere."""
        return AlarmMemory(
            tuple(self._board.alarms),
            dict(self._segment_faults),
            dict(self._points),
            self._stop,
            *self._link,
        )

    def _resume(self, memory: AlarmMemory) -> None:
        self._segment_faults = dict(memory.segment_faults)
        self._points = dict(memory.points)
        self._stop, self._link = memory.stop, (memory.is_connected, memory.link_reason)
        if self._watched.link is not None:
            self._link = memory.link_by(self._board.alarm(self._watched.link.id))

    def _is_repeated(self, block: SampleBlock) -> bool:
        """Whether the block brings nothing new; where samples are missing, delays stand still."""
        before, self._stop = self._stop, (block.epoch, block.stop_index)
        if before is None or (block.epoch, block.first_index) == before:
            return False
        if block.epoch == before[0] and block.stop_index <= before[1]:
            self._stop = before
            return True
        if block.epoch != before[0] or block.first_index > before[1]:
            self._board.interrupt()
        return False

    def _take_assessment(self, assessment: Assessment) -> None:
        bearing, readings, now_ns = assessment.bearing, assessment.readings, assessment.time_ns
        for channel, place in zip(self._channels_of[bearing], AMPLITUDES, strict=True):
            self._note_segment(channel, readings[f"order1_{place}_um_pk"])
            self._clipped_percent[channel] = 100.0 * assessment.clipped_share.get(place, 0.0)
        for axes, places in DIRECTIONS.items():
            for row in places:
                self._note_sign(self._channels_of[bearing][row], is_reversed(readings, axes))
        point = point_of(assessment)
        self._points[bearing] = (point, now_ns)
        for watch in self._watched.readings[bearing]:
            for then_ns, reading in _seen(watch, assessment):
                held = self._board.alarm(watch.id).condition.level
                condition = watch.limits.judge(reading, point, held)
                self._board.advance(watch.id, _at(point, condition), then_ns)
        for watch in self._watched.changes[bearing]:
            condition = self._change(watch, assessment, point)
            self._board.advance(watch.id, _at(point, condition), now_ns)

    def _change(
        self, watch: LimitWatch, assessment: Assessment, point: OperatingPoint
    ) -> Condition:
        """What a 1× vector says against the reference of the present state."""
        reference = self.reference(assessment.bearing, point.state)
        held = self._board.alarm(watch.id).condition.level
        readings, place = assessment.readings, watch.source
        found = (
            vector_condition(readings, place, reference, limits, held)
            for limits in watch.limits.at(point)
        )
        return worst_of(found, point)

    def _recent_point(self, subject: str, now_ns: int) -> OperatingPoint:
        """Condition of a bearing by its newest result; of anything else, the unit's state."""
        point, seen_ns = self._points.get(subject) or (NOWHERE_KNOWN, now_ns)
        if subject not in self._points and self._points:
            newest, seen_ns = max(self._points.values(), key=lambda found: found[1])
            point = OperatingPoint(newest.state)
        return point if abs(now_ns - seen_ns) <= POINT_HOLDS_NS else NOWHERE_KNOWN

    def _find(self, watch: Watch, condition: Condition, now_ns: int) -> None:
        """Take in what is found of a channel, the device or its link."""
        if condition.level is not None:
            subject = self._bearing_of.get(watch.source, watch.source)
            condition = _at(self._recent_point(subject, now_ns), condition)
        self._board.find(watch, condition, now_ns)

    def _note_segment(self, channel: str, reading: Reading) -> None:
        """Remember what only a segment shows of a channel, until another one shows otherwise."""
        if reading.value is None and reading.quality.reason in SENSOR_FAULTS:
            self._resting_with = None
            self._segment_faults[channel] = reading.quality.reason
        elif reading.value is not None and self._segment_faults.get(channel) in SENSOR_FAULTS:
            del self._segment_faults[channel]

    def _note_sign(self, channel: str, wrong_sign: bool | None) -> None:
        """Remember that a film's sign shows one of its transducers reversed, until it is right."""
        fault = self._segment_faults.get(channel)
        if wrong_sign and fault is None:
            self._resting_with = None
            self._segment_faults[channel] = Reason.POLARITY
        elif wrong_sign is False and fault is Reason.POLARITY:
            del self._segment_faults[channel]

    def _take_channels(self, block: SampleBlock) -> None:
        """Judge every channel; where all rest and nothing is new, that is a single comparison."""
        if block.channel_quality == self._resting_with:
            return
        watches = self._watched.channels
        for watch in watches:
            condition = self._channel_condition(watch.source, block)
            self._find(watch, condition, block.stop_ns)
        resting = all(self._board.alarm(watch.id).is_resting for watch in watches)
        self._resting_with = block.channel_quality if resting else None

    def _channel_condition(self, channel: str, block: SampleBlock) -> Condition:
        rows = self._rows_of[channel]
        if not rows:
            return unknown(Reason.NOT_MEASURED)
        quality = worst(block.channel_quality[row] for row in rows)
        clipped_percent = self._clipped_percent.get(channel) or None
        return channel_condition(quality, self._segment_faults.get(channel), clipped_percent)

    def _take_clock(self, block: SampleBlock, host_ns: int) -> None:
        offset, drift, stamps = self._watched.offset, self._watched.drift, self._watched.stamps
        point = self._recent_point(DEVICE, block.stop_ns)
        if offset is not None:
            self._compare(offset, offset_reading(block.clock), host_ns, point)
        if drift is not None:
            self._compare(drift, drift_reading(block.clock), host_ns, point)
        if stamps is not None:
            self._find(stamps, stamp_condition(block.stamp_fault), host_ns)

    def _take_link(self, host_ns: int) -> None:
        if self._watched.link is not None:
            self._find(self._watched.link, link_condition(*self._link), host_ns)

    def _compare(
        self, watch: LimitWatch, reading: Reading, now_ns: int, point: OperatingPoint
    ) -> None:
        alarm, value = self._board.alarm(watch.id), reading.value
        limits = watch.limits.at(point)
        is_within = value is not None and bool(limits) and all(x.is_within(value) for x in limits)
        if is_within and alarm.is_resting:
            return  # as nearly always
        condition = watch.limits.judge(reading, point, alarm.condition.level)
        self._board.find(watch, _at(point, condition), now_ns)


def _seen(watch: LimitWatch, assessment: Assessment) -> list[tuple[int, Reading]]:
    """What an alarm looks at in a result, with its times: vibration just now, or an average."""
    source = watch.source
    recent = assessment.recent if watch.is_fast else ()
    found = [(each.time_ns, each.readings[source]) for each in recent if source in each.readings]
    return found or [(assessment.time_ns, assessment.readings[source])]


def _at(point: OperatingPoint, condition: Condition) -> Condition:
    """What was found, with the operating condition under which it was, where it is a level."""
    return condition if condition.level is None else replace(condition, point=point)
