"""`ALARM_KINDS`: table of all alarm kinds of units. `watches_of`: alarm definitions of a unit."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from core.alarms.alarm import AlarmIdentity, AlarmRule
from core.alarms.rules import BearingRules, LimitRule, UnitRules
from core.condition.cells import OperatingPoint
from core.limits import AlarmLevel, Judgement
from core.machine.channel import SLOW_QUANTITIES
from core.machine.unit import Unit
from core.quality import Reading

CHANNEL_NOT_OK, LINK_LOST, FILM_STIFFNESS = "channel_not_ok", "link_lost", "film_stiffness"
"""Names of alarm kinds that other modules refer to."""

OIL_TEMPERATURE, TIME_STAMPS = "oil_temperature", "time_stamps"
"""Names of alarm kinds that are also the names of their rules."""

SLOW_LIMITS = "slow_limits"
"""Name of the rule of the limits of recorded slow channels."""

CHANNEL, BEARING, DEVICE, LINK = "channel", "bearing", "device", "link"
"""Subject types of alarms: a channel or bearing, given by its id, or a unit's device or link."""


@dataclass(frozen=True)
class AlarmKind:
    """Kind of alarm, such as "oil temperature": what it monitors, and how it is displayed.

    Parameters
    ----------
    name
        Name in the identity of an alarm. It is stored in the database and must not change.
    label
        Display name, with a capital first letter.
    unit
        Unit of measurement of the alarm's value; None if the alarm has no value.
    subject
        `CHANNEL` or `BEARING` for alarms of each channel or bearing, else the fixed subject.
    rule
        Name of the rule: a key of `BearingRules`, or a field of `UnitRules`.
    reading
        Name of the reading of an `Assessment` that is compared with limits; for a 1× vector, its
        measuring point. None if the alarm is judged in another way.
    needs
        Field of `Bearing` that must not be None for the bearing to have this alarm; None if every
        bearing has it.
    advice
        Recommended action; empty except for alarms about data acquisition.
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
    """Return a read-only table of alarm kinds by name, in the given order."""
    return MappingProxyType({kind.name: kind for kind in kinds})


def _pair(rule: str, unit: str, *texts: str) -> Iterable[AlarmKind]:
    """Yield the alarm kinds for x and for y; braces in the texts are replaced by the axis."""
    for axis in "xy":
        name, label, *rest = (text.format(axis) for text in texts)
        yield AlarmKind(name, label, unit, BEARING, rule, *rest)


UM_PK, UM_PP, MM_S_RMS = "µm 0-pk", "µm pk-pk", "mm/s rms"
SPAN, VELOCITY = "overall_shaft_{}_um_pp", "overall_bearing_{}_mm_s_rms"

ALARM_KINDS = kind_table(
    AlarmKind(CHANNEL_NOT_OK, "Channel not OK", "%", CHANNEL, "channel"),
    *_pair(
        "shaft_order1", UM_PK, "order1_shaft_{}", "Shaft vibration 1×, {}", "order1_shaft_{}_um_pk"
    ),
    *_pair("shaft_overall", UM_PP, "overall_shaft_{}", "Shaft vibration, broad-band, {}", SPAN),
    *_pair("bearing_overall", MM_S_RMS, "overall_bearing_{}", "Bearing velocity, {}", VELOCITY),
    AlarmKind(
        "eccentricity_ratio", "Eccentricity", "1", BEARING, "eccentricity", "eccentricity_ratio"
    ),
    *_pair("gap", "µm", "gap_{}", "Probe gap {}", "gap_{}_um"),
    *_pair(
        "gap",
        "µm",
        "opposite_gap_{}",
        "Gap of the probe opposite {}",
        "opposite_gap_{}_um",
        "opposite_{}",
    ),
    *_pair("shaft_zones", UM_PP, "zone_shaft_{}", "Vibration zone of the shaft, {}", SPAN),
    AlarmKind(
        "zone_shaft",
        "Vibration zone of the shaft",
        UM_PK,
        BEARING,
        "orbit_zones",
        "overall_shaft_um_pk",
    ),
    *_pair(
        "bearing_zones", MM_S_RMS, "zone_bearing_{}", "Vibration zone of the bearing, {}", VELOCITY
    ),
    *_pair(
        "shaft_change", UM_PK, "order1_change_shaft_{}", "Shaft 1× vector moved, {}", "shaft_{}"
    ),
    *_pair(
        "bearing_change",
        UM_PK,
        "order1_change_bearing_{}",
        "Bearing 1× vector moved, {}",
        "bearing_{}",
    ),
    AlarmKind(
        OIL_TEMPERATURE,
        "Oil temperature",
        "°C",
        BEARING,
        OIL_TEMPERATURE,
        "oil_temperature_c",
        OIL_TEMPERATURE,
    ),
    AlarmKind(
        "pad_temperature_excess",
        "Hottest pad above the mean",
        "K",
        BEARING,
        "pad_temperatures",
        "pad_temperature_excess_k",
    ),
    *(AlarmKind(q.name, q.label, q.unit, CHANNEL, SLOW_LIMITS) for q in SLOW_QUANTITIES.values()),
    AlarmKind(FILM_STIFFNESS, "Film stiffness changed", "%", BEARING, "films"),
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
        TIME_STAMPS,
        "Wrong time stamps",
        None,
        DEVICE,
        TIME_STAMPS,
        advice="Check the clock of the device; its time jumps, repeats or runs backwards.",
    ),
    AlarmKind(
        LINK_LOST,
        "Link lost",
        None,
        LINK,
        "link",
        advice="Find out why the device does not respond; padwatch reconnects automatically.",
    ),
)
"""All alarm kinds of a unit. The alarms of a bearing are judged in this order."""

FAST = ("shaft_order1", "shaft_overall", "bearing_overall")
"""Rules judged on every recent segment, because vibration can change within seconds. Vibration
zones are not among them, because they need steady operation (ISO 20816-1)."""

VECTORS = ("shaft_change", "bearing_change")
"""Rules that compare 1× vectors with reference vectors."""

WAVEFORM_CHANNEL, SLOW_CHANNEL = "channel", "slow_channel"
"""Rules of the kind "channel_not_ok" for waveform channels and for slow channels."""


@dataclass(frozen=True)
class Watch:
    """Definition of one alarm of a unit or of the service.

    Parameters
    ----------
    source
        Name of the judged channel, reading or measuring point, or the subject itself.
    group
        Name of the rule; alarms with the same rule are judged together.
    limits
        Limits by operating condition; None for an alarm without limits.
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
        """Return the judgement of a reading by the limits that are valid at an operating point.

        `held` is the level of the previous judgement, or None; the deadband depends on it.
        Raises `TypeError` if the alarm has no limits.
        """
        if self.limits is None:
            raise TypeError(f"alarm {self.id} has no limits, so it cannot judge a reading")
        return self.limits.judge(reading, point, held)


def watch(
    identity: AlarmIdentity, rule: AlarmRule | LimitRule, source: str, group: str = ""
) -> Watch:
    """Return the definition of an alarm; a `LimitRule` gives it limits as well as an alarm rule.

    `source` is the name of the judged channel or reading, `group` the name of the rule.
    """
    if isinstance(rule, LimitRule):
        return Watch(identity, rule.rule, source, group, rule)
    return Watch(identity, rule, source, group)


def watches_of(unit: Unit, rules: UnitRules) -> list[Watch]:
    """Return the definitions of all alarms of a unit that have a rule, each alarm once."""
    watches: list[Watch] = []

    def add(kind: AlarmKind, subject: str, source: str, group: str, own: BearingRules) -> None:
        rule: AlarmRule | LimitRule | None = own.get(group, getattr(rules, group, None))
        if rule is not None:
            watches.append(watch(AlarmIdentity(unit.id, subject, kind.name), rule, source, group))

    not_ok = ALARM_KINDS[CHANNEL_NOT_OK]
    of_bearings = [(each, rules.bearings.get(each.id, {})) for each in unit.bearings]
    for channel in unit.channels:
        add(not_ok, channel.id, channel.id, not_ok.rule, {})
    limited = [each for each in unit.slow_channels if rules.slow_limits.get(each.id)]
    oils = (b.oil_temperature for b, own in of_bearings if own.get(OIL_TEMPERATURE))
    for source in dict.fromkeys(filter(None, (*oils, *(slow.id for slow in limited)))):
        add(not_ok, source, source, SLOW_CHANNEL, {})
    for each in limited:
        own_limits = {SLOW_LIMITS: rules.slow_limits[each.id]}
        add(ALARM_KINDS[each.quantity], each.id, each.id, SLOW_LIMITS, own_limits)
    for bearing, own in of_bearings:
        slow = {OIL_TEMPERATURE: bearing.oil_temperature}
        for kind in ALARM_KINDS.values():
            is_there = kind.needs is None or getattr(bearing, kind.needs) is not None
            if kind.subject == BEARING and is_there:
                source = slow.get(kind.rule) or kind.reading or bearing.id
                add(kind, bearing.id, source, kind.rule, own)
    for kind in ALARM_KINDS.values():
        if kind.subject in (DEVICE, LINK):
            add(kind, kind.subject, kind.subject, kind.rule, {})
    return watches
