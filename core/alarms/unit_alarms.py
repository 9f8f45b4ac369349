"""`UnitAlarms`: all alarms of one unit, and what samples, results, links and people do to them."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from core.alarms.alarm import Alarm, AlarmNews
from core.alarms.board import AlarmBoard, AlarmMemory
from core.alarms.judgements import (
    CLOCK_READINGS,
    SENSOR_FAULTS,
    VectorReference,
    channel_judgement,
    link_judgement,
    slow_channel_judgement,
    stamp_judgement,
    vector_judgement,
)
from core.alarms.kinds import (
    DEVICE,
    FAST,
    LINK,
    OIL_TEMPERATURE,
    SLOW_CHANNEL,
    TIME_STAMPS,
    VECTORS,
    WAVEFORM_CHANNEL,
    LimitWatch,
    Watch,
    watches_of,
)
from core.alarms.operation import Action
from core.alarms.rules import UnitRules, point_of, worst_of
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
"""How long the operating condition of a result is taken for that of later samples."""


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
        watches = watches_of(unit, rules)
        self._board = AlarmBoard(watches)
        self._of_rule: defaultdict[str, list[Watch]] = defaultdict(list)
        self._limits_of_rule: defaultdict[str, list[LimitWatch]] = defaultdict(list)
        self._of_results: defaultdict[str, list[LimitWatch]] = defaultdict(list)
        for watch in watches:
            self._of_rule[watch.group].append(watch)
            if isinstance(watch, LimitWatch):
                self._limits_of_rule[watch.group].append(watch)
                if watch.group not in (OIL_TEMPERATURE, *CLOCK_READINGS):
                    self._of_results[watch.identity.subject].append(watch)
        of_rows = [channel.id for channel in unit.channels] if rows is None else list(rows)
        self._rows_of = {
            watch.source: [row for row, channel in enumerate(of_rows) if channel == watch.source]
            for watch in self._of_rule[WAVEFORM_CHANNEL]
        }
        self._channels_of = {bearing.id: bearing.channels for bearing in unit.bearings}
        self._bearing_of = {
            id_: bearing.id for bearing in unit.bearings for id_ in bearing.channels
        }
        self._references = {(r.bearing, r.state): r for r in references}
        self._segment_faults: dict[str, Reason] = {}
        self._clipped_percent: dict[str, float] = {}
        self._points: dict[str, tuple[OperatingPoint, int]] = {}
        self._unit_point = (NOWHERE_KNOWN, 0)
        self._stop: tuple[int, int] | None = None
        self._inactive_with: tuple[Quality, ...] | None = None
        self._link: tuple[bool, str | None] = (False, None)

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return self._board.alarms

    @property
    def is_connected(self) -> bool:
        """Whether samples arrive, as last reported."""
        return self._link[0]

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if the unit has no such alarm."""
        return self._board.alarm(id_)

    def reference(self, bearing: str, state: OperatingState) -> VectorReference | None:
        """Reference of the 1× vectors of a bearing in a state, if there is one."""
        return self._references.get((bearing, state))

    def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a new reference from the next result on."""
        self._references[reference.bearing, reference.state] = reference

    def take(
        self, block: SampleBlock, assessments: Iterable[Assessment], host_ns: int
    ) -> list[AlarmNews]:
        """Judge a block and the results that it has completed.

        Parameters
        ----------
        host_ns
            Host time, against which the device's clock is judged.
        """
        if self._is_repeated(block):
            return []
        for assessment in assessments:
            self._take_assessment(assessment)
        now_ns = block.stop_ns
        self._take_channels(block, now_ns)
        for watch in self._of_rule[SLOW_CHANNEL]:
            reading = block.slow.get(watch.source, NOT_MEASURED)
            self._update(watch, slow_channel_judgement(reading), now_ns)
        for warmth in self._limits_of_rule[OIL_TEMPERATURE]:
            reading = block.slow.get(warmth.source, NOT_MEASURED)
            point = self._recent_point(warmth.identity.subject, now_ns)
            self._compare(warmth, reading, now_ns, point)
        self._take_clock(block, self._recent_point(DEVICE, now_ns), host_ns)
        return self._board.drain_news()

    def films(self, conditions: Mapping[str, Judgement], now_ns: int) -> list[AlarmNews]:
        """Update the alarms about films.

        Parameters
        ----------
        conditions
            By id of the alarm.
        now_ns
            Time of the samples that the decision stands on.

        Raises
        ------
        KeyError
            If the unit has no such alarm about a film.
        """
        films = {watch.id: watch for watch in self._of_rule["films"]}
        for id_, condition in conditions.items():
            point = self._recent_point(films[id_].source, now_ns)
            self._board.record(films[id_].id, _at(point, condition), now_ns)
        return self._board.drain_news()

    def link(self, is_connected: bool, reason: str | None, host_ns: int) -> list[AlarmNews]:
        """Update the alarm about the link."""
        self._link = (is_connected, reason)
        self._take_link(host_ns)
        return self._board.drain_news()

    def pause(self) -> None:
        """Stop all delays up to now."""
        self._board.pause()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Judge the link and end the shelving of alarms by host time."""
        self._take_link(host_ns)
        self._board.expire(host_ns)
        return self._board.drain_news()

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Apply an action of a person.

        Raises
        ------
        KeyError
            If the unit has no such alarm.
        ActionRefusedError
            If the action does not fit the state of the alarm.
        """
        self._board.operate(id_, action, host_ns)
        return self._board.drain_news()

    def restore(
        self, alarms: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Continue after a restart from stored alarms, as `AlarmBoard.restore` does.

        Parameters
        ----------
        memory
            State at the last block, if no sample is missing since: conditions and delays continue.
        """
        self._board.restore(alarms, host_ns, memory.alarms if memory else ())
        if memory is not None:
            self._restore(memory)
        return self._board.drain_news()

    @property
    def memory(self) -> AlarmMemory:
        """State to continue from in another process, beside the events of alarms."""
        return AlarmMemory(
            tuple(self._board.alarms),
            dict(self._segment_faults),
            dict(self._points),
            self._stop,
            *self._link,
        )

    def _restore(self, memory: AlarmMemory) -> None:
        self._segment_faults = dict(memory.segment_faults)
        self._points = dict(memory.points)
        self._note_unit_point()
        self._stop, self._link = memory.stop, (memory.is_connected, memory.link_reason)
        for watch in self._of_rule[LINK]:
            self._link = memory.link_by(self._board.alarm(watch.id))

    def _is_repeated(self, block: SampleBlock) -> bool:
        """Whether a block has no new samples; where samples are missing, delays stop."""
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
        self._note_unit_point()
        for watch in self._of_results[bearing]:
            alarm = self._board.alarm(watch.id)
            if watch.group in VECTORS:
                condition = self._vector_condition(watch, assessment, point, alarm)
                self._board.record(watch.id, _at(point, condition), now_ns)
                continue
            for then_ns, reading in _judged(watch, assessment):
                held = self._board.alarm(watch.id).condition.level
                condition = watch.limits.judge(reading, point, held)
                self._board.record(watch.id, _at(point, condition), then_ns)

    def _vector_condition(
        self, watch: LimitWatch, assessment: Assessment, point: OperatingPoint, alarm: Alarm
    ) -> Judgement:
        """Compare a 1× vector with the reference of the present state."""
        reference = self.reference(assessment.bearing, point.state)
        held, readings = alarm.condition.level, assessment.readings
        found = (
            vector_judgement(readings, watch.source, reference, limits, held)
            for limits in watch.limits.at(point)
        )
        return worst_of(found, point)

    def _note_unit_point(self) -> None:
        """Keep the newest operating state of any bearing as that of the unit."""
        if self._points:
            newest, seen_ns = max(self._points.values(), key=lambda found: found[1])
            self._unit_point = (OperatingPoint(newest.state), seen_ns)

    def _recent_point(self, subject: str, now_ns: int) -> OperatingPoint:
        """Condition of a bearing by its newest result; of anything else, the unit's state."""
        point, seen_ns = self._points.get(subject, self._unit_point)
        return point if abs(now_ns - seen_ns) <= POINT_HOLDS_NS else NOWHERE_KNOWN

    def _update(self, watch: Watch, condition: Judgement, now_ns: int) -> None:
        """Update the alarm of a channel, the device or its link."""
        if condition.level is not None:
            subject = self._bearing_of.get(watch.source, watch.source)
            condition = _at(self._recent_point(subject, now_ns), condition)
        self._board.update(watch, condition, now_ns)

    def _note_segment(self, channel: str, reading: Reading) -> None:
        """Remember a fault that only a segment shows, until a segment shows the channel OK."""
        if reading.value is None and reading.quality.reason in SENSOR_FAULTS:
            self._inactive_with = None
            self._segment_faults[channel] = reading.quality.reason
        elif reading.value is not None and self._segment_faults.get(channel) in SENSOR_FAULTS:
            del self._segment_faults[channel]

    def _note_sign(self, channel: str, wrong_sign: bool | None) -> None:
        """Remember that the sign of a film's stiffness shows a reversed transducer."""
        fault = self._segment_faults.get(channel)
        if wrong_sign and fault is None:
            self._inactive_with = None
            self._segment_faults[channel] = Reason.POLARITY
        elif wrong_sign is False and fault is Reason.POLARITY:
            del self._segment_faults[channel]

    def _take_channels(self, block: SampleBlock, now_ns: int) -> None:
        """Judge every channel; one comparison while all are OK and their quality is the same."""
        if block.channel_quality == self._inactive_with:
            return
        watches = self._of_rule[WAVEFORM_CHANNEL]
        for watch in watches:
            self._update(watch, self._channel_condition(watch.source, block), now_ns)
        are_inactive = all(self._board.alarm(watch.id).is_settled_inactive for watch in watches)
        self._inactive_with = block.channel_quality if are_inactive else None

    def _channel_condition(self, channel: str, block: SampleBlock) -> Judgement:
        rows = self._rows_of[channel]
        if not rows:
            return unknown(Reason.NOT_MEASURED)
        quality = worst(block.channel_quality[row] for row in rows)
        clipped_percent = self._clipped_percent.get(channel) or None
        return channel_judgement(quality, self._segment_faults.get(channel), clipped_percent)

    def _take_clock(self, block: SampleBlock, point: OperatingPoint, host_ns: int) -> None:
        for rule, reading_of in CLOCK_READINGS.items():
            for watch in self._limits_of_rule[rule]:
                self._compare(watch, reading_of(block.clock), host_ns, point)
        for stamps in self._of_rule[TIME_STAMPS]:
            self._update(stamps, stamp_judgement(block.stamp_fault), host_ns)

    def _take_link(self, host_ns: int) -> None:
        for watch in self._of_rule[LINK]:
            self._update(watch, link_judgement(*self._link), host_ns)

    def _compare(
        self, watch: LimitWatch, reading: Reading, now_ns: int, point: OperatingPoint
    ) -> None:
        alarm, value = self._board.alarm(watch.id), reading.value
        limits = watch.limits.at(point)
        is_within = value is not None and bool(limits) and all(x.is_within(value) for x in limits)
        if is_within and alarm.is_settled_inactive:
            return  # the usual case, and the cheapest
        condition = watch.limits.judge(reading, point, alarm.condition.level)
        self._board.update(watch, _at(point, condition), now_ns)


def _judged(watch: LimitWatch, assessment: Assessment) -> list[tuple[int, Reading]]:
    """The readings that an alarm is judged by, with times: the newest segment's, or an average."""
    source = watch.source
    recent = assessment.recent if watch.group in FAST else ()
    found = [(each.time_ns, each.readings[source]) for each in recent if source in each.readings]
    return found or [(assessment.time_ns, assessment.readings[source])]


def _at(point: OperatingPoint, condition: Judgement) -> Judgement:
    """A judgement with the operating condition under which a limit was passed."""
    return condition if condition.level is None else replace(condition, point=point)
