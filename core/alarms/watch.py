"""`Watch`: one alarm to be, and what it looks at."""

from dataclasses import dataclass
from functools import cached_property

from core.alarms.alarm import AlarmIdentity, AlarmRule
from core.alarms.condition_limits import ConditionLimits


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
