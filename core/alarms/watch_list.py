"""Which alarms a unit has, and what each of them looks at."""

from dataclasses import dataclass

from core.alarms.alarm import AlarmIdentity, AlarmKind, AlarmRule
from core.alarms.bearing_watches import change_watches, reading_watches
from core.alarms.rules import BearingRules, ClockRules, LimitRule, UnitRules
from core.alarms.watch import LimitWatch, Watch
from core.machine.unit import Unit

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
        Of each bearing and direction; somebody else judges them.
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
