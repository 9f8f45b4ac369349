"""What each kind of alarm watches: rule, reading and channel of a bearing or unit."""

from dataclasses import dataclass
from functools import cached_property

from core.alarms.alarm import AlarmIdentity, AlarmKind, AlarmRule
from core.alarms.condition_limits import ConditionLimits
from core.alarms.rules import BearingRules, ClockRules, LimitRule, UnitRules, ZoneRule
from core.checks.sensor_checks import MAX_CLIPPED_SHARE
from core.limits import WITHIN, AlarmLevel, Condition
from core.machine.unit import Bearing, Unit
from core.quality import Level, Quality, Reading, Reason, missing
from core.samples.blocks import DeviceClock, StampFault


@dataclass(frozen=True)
class Watch:
    """One alarm to be, and how long its condition must last.

    Parameters
    ----------
    source
        Channel or reading that it looks at.
    """

    identity: AlarmIdentity
    rule: AlarmRule
    source: str

    @cached_property
    def id(self) -> str:
        """Of the alarm."""
        return self.identity.id


@dataclass(frozen=True)
class LimitWatch(Watch):
    """One that compares a value with limits.

    Parameters
    ----------
    is_fast
        Whether it looks at what is known of just now, and not at averages over minutes.
    """

    limits: ConditionLimits
    is_fast: bool = False


READINGS: dict[str, dict[AlarmKind, str]] = {
    "shaft_order1": {
        AlarmKind.SHAFT_X: "order1_shaft_x_um_pk",
        AlarmKind.SHAFT_Y: "order1_shaft_y_um_pk",
    },
    "shaft_overall": {
        AlarmKind.OVERALL_SHAFT_X: "overall_shaft_x_um_pp",
        AlarmKind.OVERALL_SHAFT_Y: "overall_shaft_y_um_pp",
    },
    "bearing_overall": {
        AlarmKind.OVERALL_BEARING_X: "overall_bearing_x_mm_s_rms",
        AlarmKind.OVERALL_BEARING_Y: "overall_bearing_y_mm_s_rms",
    },
    "eccentricity": {AlarmKind.ECCENTRICITY: "eccentricity_ratio"},
    "gap": {
        AlarmKind.GAP_X: "gap_x_um",
        AlarmKind.GAP_Y: "gap_y_um",
        AlarmKind.OPPOSITE_GAP_X: "opposite_gap_x_um",
        AlarmKind.OPPOSITE_GAP_Y: "opposite_gap_y_um",
    },
    "shaft_zones": {
        AlarmKind.ZONE_SHAFT_X: "overall_shaft_x_um_pp",
        AlarmKind.ZONE_SHAFT_Y: "overall_shaft_y_um_pp",
    },
    "orbit_zones": {AlarmKind.ZONE_SHAFT: "overall_shaft_um_pk"},
    "bearing_zones": {
        AlarmKind.ZONE_BEARING_X: "overall_bearing_x_mm_s_rms",
        AlarmKind.ZONE_BEARING_Y: "overall_bearing_y_mm_s_rms",
    },
}
"""The alarms of each rule of a bearing, and the reading that each of them looks at."""

FAST = ("shaft_order1", "shaft_overall", "bearing_overall")
"""Rules about what may change within seconds. Zones are for steady operation (ISO 20816-1)."""

CHANGES: dict[str, dict[AlarmKind, str]] = {
    "shaft_change": {
        AlarmKind.CHANGE_SHAFT_X: "shaft_x",
        AlarmKind.CHANGE_SHAFT_Y: "shaft_y",
    },
    "bearing_change": {
        AlarmKind.CHANGE_BEARING_X: "bearing_x",
        AlarmKind.CHANGE_BEARING_Y: "bearing_y",
    },
}
"""Likewise of the rules about vectors; the place whose vector it is."""

OPPOSITE = {AlarmKind.OPPOSITE_GAP_X: "opposite_x", AlarmKind.OPPOSITE_GAP_Y: "opposite_y"}
"""Alarms that need a probe which not every bearing has."""


def reading_watches(unit: str, bearing: Bearing, rules: BearingRules) -> tuple[LimitWatch, ...]:
    """The alarms that compare a reading of a bearing with limits."""
    return _watches(unit, bearing, rules, READINGS)


def change_watches(unit: str, bearing: Bearing, rules: BearingRules) -> tuple[LimitWatch, ...]:
    """The alarms that compare a 1× vector with its reference."""
    return _watches(unit, bearing, rules, CHANGES)


def _watches(
    unit: str, bearing: Bearing, rules: BearingRules, catalogue: dict[str, dict[AlarmKind, str]]
) -> tuple[LimitWatch, ...]:
    watches = []
    for name, sources in catalogue.items():
        rule: LimitRule | ZoneRule | None = getattr(rules, name)
        for kind, source in sources.items():
            is_there = kind not in OPPOSITE or getattr(bearing, OPPOSITE[kind]) is not None
            if rule is not None and is_there:
                identity = AlarmIdentity(unit, bearing.id, kind)
                watches.append(
                    LimitWatch(identity, rule.rule, source, rule.by_condition, name in FAST)
                )
    return tuple(watches)


DEVICE, LINK = "device", "link"
"""Subjects of alarms about the whole unit."""


@dataclass(frozen=True)
class WatchList:
    """All alarms of a unit.

    Parameters
    ----------
    channels
        One for each waveform channel, in their order.
    slow_channels
        Of those that a limit depends on.
    readings
        By bearing, to be compared with its readings.
    changes
        By bearing, to compare its 1× vectors with their references.
    temperatures
        To be compared with slow channels.
    films
        Of each bearing and direction; `core.change` judges them.
    """

    channels: tuple[Watch, ...]
    slow_channels: tuple[Watch, ...]
    readings: dict[str, tuple[LimitWatch, ...]]
    changes: dict[str, tuple[LimitWatch, ...]]
    temperatures: tuple[LimitWatch, ...]
    films: tuple[Watch, ...]
    offset: LimitWatch | None
    drift: LimitWatch | None
    stamps: Watch | None
    link: Watch | None

    @property
    def all(self) -> list[Watch]:
        """Each of them once."""
        of_bearings = [
            watch
            for bearing, watches in self.readings.items()
            for watch in (*watches, *self.changes[bearing])
        ]
        of_unit = [w for w in (self.offset, self.drift, self.stamps, self.link) if w is not None]
        return [
            *self.channels,
            *self.slow_channels,
            *of_bearings,
            *self.temperatures,
            *self.films,
            *of_unit,
        ]


def watch_list(unit: Unit, rules: UnitRules) -> WatchList:
    """The alarms that rules make of a unit."""
    temperatures = tuple(_temperatures(unit, rules))
    sources = dict.fromkeys(watch.source for watch in temperatures)
    of_bearings = [(b, rules.bearings.get(b.id, BearingRules())) for b in unit.bearings]
    return WatchList(
        channels=tuple(_channel(unit, channel.id, rules.channel) for channel in unit.channels),
        slow_channels=tuple(_channel(unit, source, rules.slow_channel) for source in sources),
        readings={b.id: reading_watches(unit.id, b, found) for b, found in of_bearings},
        changes={b.id: change_watches(unit.id, b, found) for b, found in of_bearings},
        temperatures=temperatures,
        films=_films(unit, rules.films),
        offset=_offset(unit, rules.clock),
        drift=_drift(unit, rules.clock),
        stamps=_stamps(unit, rules.clock),
        link=_link(unit, rules.link),
    )


def _identity(unit: Unit, subject: str, kind: AlarmKind) -> AlarmIdentity:
    return AlarmIdentity(unit.id, subject, kind)


def _channel(unit: Unit, channel: str, rule: AlarmRule) -> Watch:
    return Watch(_identity(unit, channel, AlarmKind.CHANNEL_NOT_OK), rule, channel)


def _limit(unit: Unit, subject: str, kind: AlarmKind, rule: LimitRule, source: str) -> LimitWatch:
    return LimitWatch(_identity(unit, subject, kind), rule.rule, source, rule.by_condition)


def _offset(unit: Unit, clock: ClockRules | None) -> LimitWatch | None:
    return _limit(unit, DEVICE, AlarmKind.CLOCK_OFFSET, clock.offset, DEVICE) if clock else None


def _drift(unit: Unit, clock: ClockRules | None) -> LimitWatch | None:
    return _limit(unit, DEVICE, AlarmKind.CLOCK_DRIFT, clock.drift, DEVICE) if clock else None


def _stamps(unit: Unit, clock: ClockRules | None) -> Watch | None:
    identity = _identity(unit, DEVICE, AlarmKind.TIME_STAMPS)
    return Watch(identity, clock.stamps, DEVICE) if clock else None


def _link(unit: Unit, rule: AlarmRule | None) -> Watch | None:
    return Watch(_identity(unit, LINK, AlarmKind.LINK_LOST), rule, LINK) if rule else None


def _films(unit: Unit, rule: AlarmRule | None) -> tuple[Watch, ...]:
    if rule is None:
        return ()
    return tuple(
        Watch(_identity(unit, bearing.id, kind), rule, bearing.id)
        for bearing in unit.bearings
        for kind in (AlarmKind.STIFFNESS_X, AlarmKind.STIFFNESS_Y)
    )


def _temperatures(unit: Unit, rules: UnitRules) -> list[LimitWatch]:
    watches = []
    for bearing in unit.bearings:
        found = rules.bearings.get(bearing.id)
        if found is None or found.oil_temperature is None or bearing.oil_temperature is None:
            continue
        kind, channel = AlarmKind.OIL_TEMPERATURE, bearing.oil_temperature
        watches.append(_limit(unit, bearing.id, kind, found.oil_temperature, channel))
    return watches


COVERAGE = 1.96
"""Standard uncertainties on each side of a value that hold the truth with 95 %."""

NO_CLOCK, NO_DRIFT = missing(Reason.NOT_MEASURED), missing(Reason.WAITING_FOR_DATA)

SENSOR_FAULTS = (Reason.DEAD, Reason.STUCK, Reason.CLIPPED)
"""What only a whole segment shows of a channel."""


def channel_condition(
    quality: Quality, segment_fault: Reason | None, clipped_percent: float | None = None
) -> Condition:
    """Whether a waveform channel may be believed.

    Parameters
    ----------
    quality
        Of its newest samples.
    segment_fault
        What the newest segment has shown, if anything.
    clipped_percent
        Of the samples of that segment.
    """
    fault = segment_fault if quality.level is Level.GOOD else quality.reason
    if fault is None:
        return WITHIN
    if fault is Reason.CLIPPED and clipped_percent is not None:
        limit = 100.0 * MAX_CLIPPED_SHARE
        return Condition(AlarmLevel.ALERT, value=clipped_percent, limit=limit, reason=fault)
    return Condition(AlarmLevel.ALERT, reason=fault)


def slow_channel_condition(reading: Reading) -> Condition:
    """Whether a slow channel that an alarm depends on delivers a value."""
    if reading.value is None:
        return Condition(AlarmLevel.ALERT, reason=reading.quality.reason)
    return WITHIN


def offset_reading(clock: DeviceClock | None) -> Reading:
    """How far a device's time stamps are off the host's clock, s, either way."""
    if clock is None or clock.offset_s is None:
        return NO_CLOCK
    return Reading(abs(clock.offset_s))


def drift_reading(clock: DeviceClock | None) -> Reading:
    """How much a device surely samples faster or slower than it says, parts per million."""
    if clock is None or clock.drift_ppm is None or clock.u_drift_ppm is None:
        return NO_DRIFT
    return Reading(max(0.0, abs(clock.drift_ppm) - COVERAGE * clock.u_drift_ppm))


def stamp_condition(fault: StampFault | None) -> Condition:
    """Whether a device's own time stamp could be used."""
    return WITHIN if fault is None else Condition(AlarmLevel.ALERT, reason=fault)


def link_condition(is_connected: bool, reason: str | None) -> Condition:
    """Whether samples of a unit arrive."""
    if is_connected:
        return WITHIN
    return Condition(AlarmLevel.ALERT, reason=reason or "not connected")
