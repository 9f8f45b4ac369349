"""What is watched of a bearing by its readings."""

from core.alarms.alarm import AlarmIdentity, AlarmKind
from core.alarms.rules import BearingRules, LimitRule, ZoneRule
from core.alarms.watch import LimitWatch
from core.machine.unit import Bearing

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
