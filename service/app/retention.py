"""For how long results are kept, from the plant file."""

from core.units import DAY_NS
from service.settings.retention import RetentionSettings
from service.store.retention.limits import RetentionLimits


def retention_limits(settings: RetentionSettings) -> RetentionLimits:
    """Ages as the plant file has them; 0 there is for ever."""
    return RetentionLimits(
        readings_ns=_age_ns(settings.readings_days),
        minutes_ns=_age_ns(settings.minutes_days),
        ten_minutes_ns=_age_ns(settings.ten_minutes_days),
        films_ns=_age_ns(settings.films_days),
        letters_ns=_age_ns(settings.messages_days),
    )


def _age_ns(days: float) -> int | None:
    return round(days * DAY_NS) if days > 0.0 else None
