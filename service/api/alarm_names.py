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
