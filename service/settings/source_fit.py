"""Whether a unit's source gives what the unit's channels and bearings need."""

from collections.abc import Iterable, Sequence

from service.settings.base import MisfitError
from service.settings.can import CanSettings
from service.settings.modbus_link import ModbusLinkSettings
from service.settings.modbus_sources import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)
from service.settings.sources import SourceSettings


def require_source_fit(
    source: SourceSettings,
    beside: SlowDeviceSettings | None,
    channels: Sequence[str],
    slow: Sequence[str],
) -> None:
    """Refuse a source that lacks a channel, or a second device that gives none.

    Parameters
    ----------
    beside
        The device that slow channels are polled from, if there is one.
    channels, slow
        Ids of the unit's waveform and slow channels.

    Raises
    ------
    MisfitError
        Saying which, and what is needed.
    """
    if beside is not None:
        beside.require_fit(slow)
    own = [id_ for id_ in slow if beside is None or id_ not in beside.mapped_channels]
    match source:
        case ModbusVectorSettings() | ModbusPolledSettings():
            source.require_fit(channels, own)
        case ModbusFifoSettings():
            source.fifo_layout(len(channels))
        case CanSettings():
            source.check_channels(channels, own)


def require_lines_apart(readers: Iterable[tuple[tuple[int | str, ...], object]]) -> None:
    """Refuse a serial line that two devices of the plant file are read on: it has one master.

    Parameters
    ----------
    readers
        Where in the file each device stands, and its settings.

    Raises
    ------
    MisfitError
        Naming who reads it already.
    """
    taken: dict[str, tuple[int | str, ...]] = {}
    for at, device in readers:
        if not isinstance(device, ModbusLinkSettings) or device.device in (None, "pty"):
            continue
        line = str(device.device)
        if line in taken:
            _, number, key = taken[line]
            raise MisfitError(
                f"is read by {key} of unit[{int(number) + 1}] already: a serial line has one"
                " source; give each its own, or read the others over a gateway, with host",
                *at,
                "device",
            )
        taken[line] = at
