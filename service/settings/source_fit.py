"""Whether a unit's source gives what the unit's channels and bearings need."""

from collections.abc import Sequence

from service.settings.base import MisfitError
from service.settings.modbus_sources import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)
from service.settings.sources import SourceSettings

MIN_WAVEFORM_RATE_HZ = 20.0
_SAME_RATE = 1e-9


def require_source_fit(
    source: SourceSettings, rate_hz: float, channels: Sequence[str], slow: Sequence[str]
) -> None:
    """Refuse a source that lacks a channel, or samples at another rate than the unit says.

    Parameters
    ----------
    channels, slow
        Ids of the unit's waveform and slow channels.

    Raises
    ------
    MisfitError
        Saying which, and what is needed.
    """
    match source:
        case ModbusVectorSettings():
            source.require_fit(channels, slow)
            _require_rate(rate_hz, source.rate_hz)
            return
        case ModbusPolledSettings():
            source.require_fit(channels, slow)
            _require_rate(rate_hz, source.rate_hz)
        case ModbusFifoSettings():
            source.fifo_layout(len(channels))
    if rate_hz < MIN_WAVEFORM_RATE_HZ:
        raise MisfitError(f"must be {MIN_WAVEFORM_RATE_HZ:g} or more for waveforms", "rate_hz")


def require_slow_fit(source: SlowDeviceSettings | None, slow: Sequence[str]) -> None:
    """Refuse a device of slow values that gives none of the unit's.

    Raises
    ------
    MisfitError
        Naming those that there are.
    """
    if source is not None:
        source.require_fit(slow)


def _require_rate(rate_hz: float, polls_per_s: float) -> None:
    if abs(rate_hz - polls_per_s) > _SAME_RATE * polls_per_s:
        raise MisfitError(f"must be one over poll_period_s, {polls_per_s:.12g}", "rate_hz")
