"""Words of alarms in the API; tests hold them against those of core."""

from typing import Literal

AlarmLevelName = Literal["alert", "danger"]

AlarmStateName = Literal[
    "normal",
    "unacknowledged",
    "acknowledged",
    "returned_unacknowledged",
    "shelved",
    "suppressed",
    "out_of_service",
]

AlarmKindName = Literal[
    "channel_not_ok",
    "order1_shaft_x",
    "order1_shaft_y",
    "order1_change_shaft_x",
    "order1_change_shaft_y",
    "order1_change_bearing_x",
    "order1_change_bearing_y",
    "overall_shaft_x",
    "overall_shaft_y",
    "overall_bearing_x",
    "overall_bearing_y",
    "zone_shaft_x",
    "zone_shaft_y",
    "zone_shaft",
    "zone_bearing_x",
    "zone_bearing_y",
    "eccentricity_ratio",
    "gap_x",
    "gap_y",
    "opposite_gap_x",
    "opposite_gap_y",
    "oil_temperature",
    "stiffness_x",
    "stiffness_y",
    "clock_offset",
    "clock_drift",
    "time_stamps",
    "link_lost",
    "samples_lost",
    "results_not_stored",
    "results_lost",
    "blocks_waiting",
    "analysis_late",
    "captures_not_kept",
    "disk_nearly_full",
]

AlarmChangeName = Literal[
    "raised",
    "escalated",
    "eased",
    "returned",
    "latched",
    "reset",
    "acknowledged",
    "shelved",
    "unshelved",
    "suppressed",
    "unsuppressed",
    "taken_out_of_service",
    "returned_to_service",
    "commented",
    "condition_unknown",
    "condition_known",
]
