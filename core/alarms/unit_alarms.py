"""`UnitAlarms`: all alarms of a unit, updated from samples, assessments, film changes and link."""

from collections import defaultdict, deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter

from core.alarms.alarm import Alarm, AlarmNews
from core.alarms.board import AlarmBoard, AlarmMemory, is_same_occurrence
from core.alarms.judgements import (
    CLOCK_READINGS,
    VectorReference,
    channel_judgement,
    fault_after_segment,
    fault_judgement,
    film_judgement,
    vector_judgement,
)
from core.alarms.kinds import (
    DEVICE,
    FAST,
    LINK,
    LINK_LOST,
    OIL_TEMPERATURE,
    SLOW_CHANNEL,
    SLOW_LIMITS,
    TIME_STAMPS,
    VECTORS,
    WAVEFORM_CHANNEL,
    Watch,
    watches_of,
)
from core.alarms.rules import UnitRules, point_of
from core.condition.cells import NOWHERE_KNOWN, OperatingPoint
from core.condition.operating_state import OperatingState
from core.limits import Judgement, unknown
from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from core.quality import NOT_MEASURED, Quality, Reading, Reason, worst
from core.samples.blocks import SampleBlock
from core.stiffness.estimators import is_reversed
from core.stiffness.order_line import AMPLITUDES, DIRECTIONS
from core.units import NS_PER_S

POINT_HOLDS_NS = 300 * NS_PER_S
"""Time for which the operating condition of an assessment remains valid for later samples."""


class UnitAlarms(AlarmBoard):
    """Alarms of one unit.

    Parameters
    ----------
    rules
        Alarm rules; a stored alarm whose rule has been removed can only be acknowledged.
    rows
        Channel id of each row of a block; by default, the unit's channels in order.
    references
        Reference 1× vectors of bearings, one entry per bearing and operating state.
    """

    def __init__(
        self,
        unit: Unit,
        rules: UnitRules,
        rows: Sequence[str] | None = None,
        references: Iterable[VectorReference] = (),
    ) -> None:
        watches = watches_of(unit, rules)
        super().__init__(watches)
        self._of_rule: defaultdict[str, list[Watch]] = defaultdict(list)
        self._of_results: defaultdict[str, list[Watch]] = defaultdict(list)
        for watch in watches:
            self._of_rule[watch.group].append(watch)
            if watch.limits and watch.group not in (OIL_TEMPERATURE, SLOW_LIMITS, *CLOCK_READINGS):
                self._of_results[watch.identity.subject].append(watch)
        of_rows = [channel.id for channel in unit.channels] if rows is None else list(rows)
        self._rows_of = {
            watch.source: [row for row, channel in enumerate(of_rows) if channel == watch.source]
            for watch in self._of_rule[WAVEFORM_CHANNEL]
        }
        self._channels_of = {bearing.id: bearing.channels for bearing in unit.bearings}
        self._bearing_of = {
            id_: bearing.id for bearing in unit.bearings for id_ in bearing.channels
        } | {slow.id: slow.bearing for slow in unit.slow_channels if slow.bearing}
        self._references = {(r.bearing, r.state): r for r in references}
        self._segment_faults: dict[str, Reason] = {}
        self._clipped_percent: dict[str, float] = {}
        self._points: dict[str, tuple[OperatingPoint, int]] = {}
        self._stop: tuple[int, int] | None = None
        self._inactive_with: tuple[Quality, ...] | None = None
        self._link: tuple[bool, str | None] = (False, None)

    @property
    def is_connected(self) -> bool:
        """Whether the link to the device was up in the newest link update."""
        return self._link[0]

    def reference(self, bearing: str, state: OperatingState) -> VectorReference | None:
        """Return the reference 1× vectors of a bearing in an operating state; None if not set."""
        return self._references.get((bearing, state))

    def refer_to(self, reference: VectorReference) -> None:
        """Set the reference 1× vectors of a bearing and state; the next assessment uses them."""
        self._references[reference.bearing, reference.state] = reference

    def take(
        self, block: SampleBlock, assessments: Iterable[Assessment], host_ns: int
    ) -> list[AlarmNews]:
        """Update the alarms from a block and new assessments; return the changed alarms.

        A block without new samples has no effect. `host_ns` is the time for device clock alarms.
        """
        if self._is_repeated(block):
            return []
        now_ns = block.stop_ns
        self._take_channels(block, deque(assessments))
        for watch in self._of_rule[SLOW_CHANNEL]:
            reading = block.slow.get(watch.source, NOT_MEASURED)
            fault = reading.quality.reason if reading.value is None else None
            self._update(watch, fault_judgement(fault), now_ns)
        for watch in (*self._of_rule[OIL_TEMPERATURE], *self._of_rule[SLOW_LIMITS]):
            reading, subject = block.slow.get(watch.source, NOT_MEASURED), watch.identity.subject
            point = self._recent_point(self._bearing_of.get(subject, subject), now_ns)
            self._compare(watch, reading, now_ns, point)
        point = self._recent_point(DEVICE, now_ns)
        for rule, reading_of in CLOCK_READINGS.items():
            for watch in self._of_rule[rule]:
                self._compare(watch, reading_of(block.clock), host_ns, point)
        for watch in self._of_rule[TIME_STAMPS]:
            self._update(watch, fault_judgement(block.stamp_fault), host_ns)
        return self.drain_news()

    def films(
        self, conditions: Mapping[str, Mapping[str, Judgement]], now_ns: int
    ) -> list[AlarmNews]:
        """Update film alarms at the sample time `now_ns`; return the changed alarms.

        `conditions` are the judgements of each direction, "x" and "y", by alarm id.

        Raises KeyError if the unit has no film-stiffness alarm with one of the ids.
        """
        films = {watch.id: watch for watch in self._of_rule["films"]}
        for id_, found in conditions.items():
            condition = film_judgement(found, self.alarm(id_).condition)
            point = self._recent_point(films[id_].source, now_ns)
            self.record(id_, _at(point, condition), now_ns)
        return self.drain_news()

    def link(self, is_connected: bool, reason: str | None, host_ns: int) -> list[AlarmNews]:
        """Update the link alarm; return the changed alarms. `reason` is why the link is down."""
        self._link = (is_connected, reason)
        self._take_link(host_ns)
        return self.drain_news()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Judge the link and end expired shelving at a host time; return the changed alarms."""
        self._take_link(host_ns)
        return super().tick(host_ns)

    def restore(
        self, stored: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Restore the alarms after a restart; return the alarms that this changes.

        `stored` are the alarms as stored; `memory` is None if samples were lost since the last
        block. A link event since then overrides the memory: a lost link stays lost until samples
        arrive.
        """
        news = super().restore(stored, host_ns, memory)
        if memory is not None:
            self._segment_faults = dict(memory.segment_faults)
            self._points = dict(memory.points)
            self._stop, self._link = memory.stop, (memory.is_connected, memory.link_reason)
            kept = {alarm.identity.id: alarm for alarm in memory.alarms}
            for watch in self._of_rule[LINK]:
                alarm = self.alarm(watch.id)
                if not is_same_occurrence(kept.get(watch.id, Alarm(watch.identity)), alarm):
                    is_lost = alarm.level is not None
                    self._link = (not is_lost, alarm.condition.reason if is_lost else None)
        return news

    @property
    def memory(self) -> AlarmMemory:
        """State from which another process continues, in addition to the stored alarm events."""
        return AlarmMemory(
            tuple(self.alarms),
            dict(self._segment_faults),
            dict(self._points),
            self._stop,
            *self._link,
        )

    def _is_repeated(self, block: SampleBlock) -> bool:
        """Whether a block has no new samples; pause the delays if samples are missing before it."""
        before, self._stop = self._stop, (block.epoch, block.stop_index)
        if before is None or (block.epoch, block.first_index) == before:
            return False
        if block.epoch == before[0] and block.stop_index <= before[1]:
            self._stop = before
            return True
        if block.epoch != before[0] or block.first_index > before[1]:
            self.pause(spared=LINK_LOST)
        return False

    def _take_assessment(self, assessment: Assessment) -> None:
        bearing, readings, now_ns = assessment.bearing, assessment.readings, assessment.time_ns
        wrong_signs = {axes: is_reversed(readings, axes) for axes in DIRECTIONS}
        for channel, place in zip(self._channels_of[bearing], AMPLITUDES, strict=True):
            amplitude, wrong_sign = readings[f"order1_{place}_um_pk"], wrong_signs[2 * place[-1]]
            before = self._segment_faults.pop(channel, None)
            fault = fault_after_segment(before, amplitude, wrong_sign)
            if fault is not None:
                self._segment_faults[channel] = fault
                self._inactive_with = None
            self._clipped_percent[channel] = 100.0 * assessment.clipped_share.get(place, 0.0)
        point = point_of(assessment)
        self._points[bearing] = (point, now_ns)
        reference = self.reference(bearing, point.state)
        for watch in self._of_results[bearing]:
            if watch.group in VECTORS:
                held = self.alarm(watch.id).condition.level
                condition = vector_judgement(readings, watch, reference, point, held)
                self.record(watch.id, _at(point, condition), now_ns)
                continue
            for then_ns, reading in _judged(watch, assessment):
                condition = watch.judge(reading, point, self.alarm(watch.id).condition.level)
                self.record(watch.id, _at(point, condition), then_ns)

    def _recent_point(self, subject: str, now_ns: int) -> OperatingPoint:
        """Return the newest operating point of a bearing, if it is recent enough.

        For other subjects, return only the operating state of the unit.
        """
        if subject in self._points:
            point, seen_ns = self._points[subject]
        elif self._points:
            newest, seen_ns = max(self._points.values(), key=itemgetter(1))
            point = OperatingPoint(newest.state)
        else:
            return NOWHERE_KNOWN
        return point if abs(now_ns - seen_ns) <= POINT_HOLDS_NS else NOWHERE_KNOWN

    def _update(self, watch: Watch, condition: Judgement, now_ns: int) -> None:
        """Update the alarm of a channel, the device or the link."""
        if condition.level is not None:
            subject = self._bearing_of.get(watch.source, watch.source)
            condition = _at(self._recent_point(subject, now_ns), condition)
        self.update(watch, condition, now_ns)

    def _compare(self, watch: Watch, reading: Reading, now_ns: int, point: OperatingPoint) -> None:
        alarm, value = self.alarm(watch.id), reading.value
        limits = watch.limits.at(point) if watch.limits and alarm.is_settled_inactive else ()
        if value is not None and limits and not any(each.passed(value, None) for each in limits):
            return  # fast path: inactive alarm, value within all limits
        condition = watch.judge(reading, point, alarm.condition.level)
        self.update(watch, _at(point, condition), now_ns)

    def _take_channels(self, block: SampleBlock, assessments: deque[Assessment]) -> None:
        """Judge the channels in each cell of a block, after the assessments up to its end.

        A block may contain several segments. The order of time makes the alarms independent of the
        block length, which differs between devices. Cells with unchanged qualities are skipped.
        """
        if not assessments and block.channel_quality == self._inactive_with:
            return
        watches = self._of_rule[WAVEFORM_CHANNEL]
        half_ns = round(0.5 * NS_PER_S / block.rate_hz)
        cells = list(block.cell_qualities())
        for number, (qualities, stop_ns) in enumerate(cells, start=1):
            is_last = number == len(cells)
            while assessments and (is_last or assessments[0].time_ns <= stop_ns + half_ns):
                self._take_assessment(assessments.popleft())
            if qualities == self._inactive_with:
                continue
            for watch in watches:
                channel, rows = watch.source, self._rows_of[watch.source]
                clipped_percent = self._clipped_percent.get(channel) or None
                quality = worst(qualities[row] for row in rows)
                fault = self._segment_faults.get(channel)
                found = channel_judgement(quality, fault, clipped_percent)
                self._update(watch, found if rows else unknown(Reason.NOT_MEASURED), stop_ns)
            are_inactive = all(self.alarm(watch.id).is_settled_inactive for watch in watches)
            self._inactive_with = qualities if are_inactive else None

    def _take_link(self, host_ns: int) -> None:
        is_connected, reason = self._link
        for watch in self._of_rule[LINK]:
            fault = None if is_connected else reason or "not connected"
            self._update(watch, fault_judgement(fault), host_ns)


def _judged(watch: Watch, assessment: Assessment) -> list[tuple[int, Reading]]:
    """Return the readings that an alarm is judged by, with their times in ns.

    The rules `FAST` use the readings of recent segments, other rules the averaged reading.
    """
    source = watch.source
    recent = assessment.recent if watch.group in FAST else ()
    found = [(each.time_ns, each.readings[source]) for each in recent if source in each.readings]
    return found or [(assessment.time_ns, assessment.readings[source])]


def _at(point: OperatingPoint, condition: Judgement) -> Judgement:
    """Return a judgement with the operating point added if a limit is exceeded."""
    return condition if condition.level is None else replace(condition, point=point)
