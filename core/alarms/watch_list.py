"""Which alarms a unit has, and what each of them looks at."""

from dataclasses import dataclass
from functools import cached_property

from core.alarms.alarm import AlarmIdentity, AlarmKind, AlarmRule
from core.alarms.limits import Limits
from core.alarms.rules import ClockRules, LimitRule, UnitRules
from core.machine import Unit

DEVICE, LINK = "device", "link"
"""Subjects of alarms about the whole unit."""


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
    """One that compares a value with limits."""

    limits: Limits


@dataclass(frozen=True)
class WatchList:
    """All alarms of a unit.

    Parameters
    ----------
    channels
        One for each waveform channel, in their order.
    slow_channels
        Of those that a limit depends on.
    amplitudes
        By bearing, to be compared with its readings.
    temperatures
        To be compared with slow channels.
    films
        Of each bearing and direction; somebody else judges them.
    """

    channels: tuple[Watch, ...]
    slow_channels: tuple[Watch, ...]
    amplitudes: dict[str, tuple[LimitWatch, ...]]
    temperatures: tuple[LimitWatch, ...]
    films: tuple[Watch, ...]
    offset: LimitWatch | None
    drift: LimitWatch | None
    stamps: Watch | None
    link: Watch | None

    @property
    def all(self) -> list[Watch]:
        """Each of them once."""
        of_bearings = [watch for watches in self.amplitudes.values() for watch in watches]
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
    return WatchList(
        channels=tuple(_channel(unit, channel.id, rules.channel) for channel in unit.channels),
        slow_channels=tuple(_channel(unit, source, rules.slow_channel) for source in sources),
        amplitudes={bearing.id: _amplitudes(unit, bearing.id, rules) for bearing in unit.bearings},
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
    return LimitWatch(_identity(unit, subject, kind), rule.rule, source, rule.limits)


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


def _amplitudes(unit: Unit, bearing: str, rules: UnitRules) -> tuple[LimitWatch, ...]:
    found = rules.bearings.get(bearing)
    if found is None or found.shaft_order1 is None:
        return ()
    return tuple(
        _limit(unit, bearing, kind, found.shaft_order1, f"{kind}_um_pk")
        for kind in (AlarmKind.SHAFT_X, AlarmKind.SHAFT_Y)
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
