"""`ALARM_KINDS`: the kinds of alarms of a unit, and the alarms that rules make of it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from core.alarms.alarm import AlarmIdentity, AlarmRule
from core.alarms.rules import BearingRules, LimitRule, UnitRules
from core.condition.cells import OperatingPoint
from core.limits import AlarmLevel, Judgement
from core.machine.unit import Unit
from core.quality import Reading

CHANNEL_NOT_OK, LINK_LOST = "channel_not_ok", "link_lost"
"""Kinds that are known by name beyond this table."""

CHANNEL, BEARING, DEVICE, LINK = "channel", "bearing", "device", "link"
"""Subjects of alarms: a channel or bearing, named by its id; the device or the link of a unit."""


@dataclass(frozen=True)
class AlarmKind:
    """One kind of alarm. Rules, API, plant file, mail and dashboard read its fields here.

    Parameters
    ----------
    name
        Part of the identity of an alarm. It is stored and never changes.
    label
        Words for people, beginning with a capital.
    unit
        Unit of the alarm's value; None if it has no value.
    subject
        `CHANNEL` or `BEARING` if the alarm is about one of them, else the subject itself.
    rule
        Field of `BearingRules` or `UnitRules` that holds its rule.
    reading
        Reading of an assessment that is compared with limits; for a 1× vector, its place.
    needs
        Part that a bearing must have: a field of `Bearing` that is not None.
    advice
        What to do about it, for alarms about the way of samples into padwatch.
    """

    name: str
    label: str
    unit: str | None
    subject: str
    rule: str
    reading: str | None = None
    needs: str | None = None
    advice: str = field(default="", kw_only=True)


def kind_table(*kinds: AlarmKind) -> Mapping[str, AlarmKind]:
    """Kinds by name, in the given order."""
    return MappingProxyType({kind.name: kind for kind in kinds})


def _on_bearing(
    rule: str, unit: str, *kinds: tuple[str, str] | tuple[str, str, str] | tuple[str, str, str, str]
) -> Iterable[AlarmKind]:
    """Kinds of one rule, by name, label, reading and what a bearing must have for it."""
    return (AlarmKind(name, label, unit, BEARING, rule, *rest) for name, label, *rest in kinds)


ALARM_KINDS = kind_table(
    AlarmKind(CHANNEL_NOT_OK, "Channel not OK", "%", CHANNEL, "channel"),
    *_on_bearing(
        "shaft_order1",
        "µm 0-pk",
        ("order1_shaft_x", "Shaft vibration 1×, x", "order1_shaft_x_um_pk"),
        ("order1_shaft_y", "Shaft vibration 1×, y", "order1_shaft_y_um_pk"),
    ),
    *_on_bearing(
        "shaft_overall",
        "µm pk-pk",
        ("overall_shaft_x", "Shaft vibration, broad-band, x", "overall_shaft_x_um_pp"),
        ("overall_shaft_y", "Shaft vibration, broad-band, y", "overall_shaft_y_um_pp"),
    ),
    *_on_bearing(
        "bearing_overall",
        "mm/s rms",
        ("overall_bearing_x", "Bearing velocity, x", "overall_bearing_x_mm_s_rms"),
        ("overall_bearing_y", "Bearing velocity, y", "overall_bearing_y_mm_s_rms"),
    ),
    *_on_bearing("eccentricity", "1", ("eccentricity_ratio", "Eccentricity", "eccentricity_ratio")),
    *_on_bearing(
        "gap",
        "µm",
        ("gap_x", "Probe gap x", "gap_x_um"),
        ("gap_y", "Probe gap y", "gap_y_um"),
        ("opposite_gap_x", "Gap of the probe opposite x", "opposite_gap_x_um", "opposite_x"),
        ("opposite_gap_y", "Gap of the probe opposite y", "opposite_gap_y_um", "opposite_y"),
    ),
    *_on_bearing(
        "shaft_zones",
        "µm pk-pk",
        ("zone_shaft_x", "Vibration zone of the shaft, x", "overall_shaft_x_um_pp"),
        ("zone_shaft_y", "Vibration zone of the shaft, y", "overall_shaft_y_um_pp"),
    ),
    *_on_bearing(
        "orbit_zones",
        "µm 0-pk",
        ("zone_shaft", "Vibration zone of the shaft", "overall_shaft_um_pk"),
    ),
    *_on_bearing(
        "bearing_zones",
        "mm/s rms",
        ("zone_bearing_x", "Vibration zone of the bearing, x", "overall_bearing_x_mm_s_rms"),
        ("zone_bearing_y", "Vibration zone of the bearing, y", "overall_bearing_y_mm_s_rms"),
    ),
    *_on_bearing(
        "shaft_change",
        "µm 0-pk",
        ("order1_change_shaft_x", "Shaft 1× vector moved, x", "shaft_x"),
        ("order1_change_shaft_y", "Shaft 1× vector moved, y", "shaft_y"),
    ),
    *_on_bearing(
        "bearing_change",
        "µm 0-pk",
        ("order1_change_bearing_x", "Bearing 1× vector moved, x", "bearing_x"),
        ("order1_change_bearing_y", "Bearing 1× vector moved, y", "bearing_y"),
    ),
    *_on_bearing(
        "oil_temperature",
        "°C",
        ("oil_temperature", "Oil temperature", "oil_temperature_c", "oil_temperature"),
    ),
    *_on_bearing(
        "films",
        "1",
        ("stiffness_x", "Film stiffness changed, x"),
        ("stiffness_y", "Film stiffness changed, y"),
    ),
    AlarmKind(
        "clock_offset",
        "Device clock off",
        "s",
        DEVICE,
        "clock_offset",
        advice="Set the clock of the device, or its time server.",
    ),
    AlarmKind(
        "clock_drift",
        "Device clock drifts",
        "ppm",
        DEVICE,
        "clock_drift",
        advice="Compare the sampling rate in the plant file with the device’s own.",
    ),
    AlarmKind(
        "time_stamps",
        "Wrong time stamps",
        None,
        DEVICE,
        "time_stamps",
        advice="Look at the clock of the device: its time jumps, repeats or runs backwards.",
    ),
    AlarmKind(
        LINK_LOST,
        "Link lost",
        None,
        LINK,
        "link",
        advice="Find out why the device does not answer; padwatch connects again by itself.",
    ),
)
"""All kinds of a unit's alarms. Alarms of one bearing are judged in this order."""

FILM_KINDS = tuple(kind.name for kind in ALARM_KINDS.values() if kind.rule == "films")
"""Kinds of alarms about the film, in the order of a film's findings: x, y."""

FAST = ("shaft_order1", "shaft_overall", "bearing_overall")
"""Rules about what may change within seconds. Zones are for steady operation (ISO 20816-1)."""

VECTORS = ("shaft_change", "bearing_change")
"""Rules that compare 1× vectors with references."""

WAVEFORM_CHANNEL, SLOW_CHANNEL = "channel", "slow_channel"
"""Rules of the kind "channel_not_ok", by what the channel delivers."""

OIL_TEMPERATURE, TIME_STAMPS = "oil_temperature", "time_stamps"


@dataclass(frozen=True)
class Watch:
    """An alarm that a unit or the service can have.

    Parameters
    ----------
    source
        What is judged: a channel, a reading, the place of a vector, or the subject itself.
    group
        Name of its rule, by which alarms are judged together.
    limits
        Limits that a value is compared with; None if it has none.
    """

    identity: AlarmIdentity
    rule: AlarmRule
    source: str
    group: str = ""
    limits: LimitRule | None = None

    @cached_property
    def id(self) -> str:
        """Id of the alarm."""
        return self.identity.id

    def judge(self, reading: Reading, point: OperatingPoint, held: AlarmLevel | None) -> Judgement:
        """Compare a reading with the limits. Raises `TypeError` if the alarm has none."""
        if self.limits is None:
            raise TypeError(f"{self.id} has no limits")
        return self.limits.judge(reading, point, held)


def watch(
    identity: AlarmIdentity, rule: AlarmRule | LimitRule, source: str, group: str = ""
) -> Watch:
    """The alarm that a rule makes."""
    if isinstance(rule, LimitRule):
        return Watch(identity, rule.rule, source, group, rule)
    return Watch(identity, rule, source, group)


def watches_of(unit: Unit, rules: UnitRules) -> list[Watch]:
    """The alarms that rules make of a unit, each of them once."""
    watches: list[Watch] = []

    def add(kind: AlarmKind, subject: str, source: str, group: str, owner: object) -> None:
        rule: AlarmRule | LimitRule | None = getattr(owner, group)
        if rule is not None:
            watches.append(watch(AlarmIdentity(unit.id, subject, kind.name), rule, source, group))

    not_ok = ALARM_KINDS[CHANNEL_NOT_OK]
    for channel in unit.channels:
        add(not_ok, channel.id, channel.id, not_ok.rule, rules)
    of_bearings = [(each, rules.bearings.get(each.id, BearingRules())) for each in unit.bearings]
    for source in dict.fromkeys(b.oil_temperature for b, own in of_bearings if own.oil_temperature):
        if source is not None:
            add(not_ok, source, source, SLOW_CHANNEL, rules)
    for bearing, own in of_bearings:
        slow = {OIL_TEMPERATURE: bearing.oil_temperature}
        for kind in ALARM_KINDS.values():
            is_there = kind.needs is None or getattr(bearing, kind.needs) is not None
            if kind.subject == BEARING and is_there:
                source = slow.get(kind.rule) or kind.reading or bearing.id
                add(kind, bearing.id, source, kind.rule, own if hasattr(own, kind.rule) else rules)
    for kind in ALARM_KINDS.values():
        if kind.subject in (DEVICE, LINK):
            add(kind, kind.subject, kind.subject, kind.rule, rules)
    return watches
