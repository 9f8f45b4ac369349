"""Conversion of CAN settings to settings of the CAN adapter and of the simulated CAN DAQ."""

from pathlib import Path
from typing import Any

from acquisition.can.compiler import compile_plan
from acquisition.can.settings import CanChannel, CanLinkSettings, CanSettings, CanSlowChannel
from acquisition.clock import Clock
from acquisition.delivery.units import UNIT_OF
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_server import CanBusServer
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, daq_settings
from acquisition.simulated.devices.can_slcan import SlcanPtyServer, SlcanTcpServer
from acquisition.simulated.devices.server import DaqServer
from acquisition.simulated.feed import SampleFeed
from core.checks.channels import COUNTS_FULL_SCALE
from service.settings.core_values import calibration_of
from service.settings.sources import can as settings
from service.settings.units import UnitSettings


def can_settings_of(unit: UnitSettings, source: settings.CanSettings) -> CanSettings:
    """Return the settings of the CAN adapter for a unit."""
    link = CanLinkSettings(**source.values_for(CanLinkSettings))
    others = source.model_dump(include={"hold_s", "stale_after_s", "when_full", "stamps"})
    others["queue_frames"] = source.receive_buffer
    units = tuple(UNIT_OF[channel.measurand] for channel in unit.channel)
    if source.profile is not None:
        return daq_settings(can_shape_of(unit, source), link, units, **others)
    channels = tuple(
        CanChannel(
            channel.id, engineering_unit, signals if isinstance(signals, tuple) else (signals,)
        )
        for channel, engineering_unit in zip(unit.channel, units, strict=True)
        for signals in [source.signals[channel.id]]
    )
    slow = tuple(CanSlowChannel(s.id, s.unit, source.slow[s.id]) for s in unit.slow_channel)
    own = {"link": link, "dbc": source.dbc_path, "channels": channels, "slow": slow}
    return CanSettings(**source.values_for(CanSettings) | others | own)


def can_shape_of(unit: UnitSettings, source: settings.CanSettings) -> CanShape:
    """Return the messages of the simulated CAN DAQ for the channels of a unit.

    Raises `LookupError` if the source of the unit reads CAN by a DBC file instead of a profile.
    """
    if source.profile is None:
        raise LookupError(
            f"unit {unit.id} reads CAN by its own DBC; a simulated DAQ sends profile"
            ' "padwatch_int16" or "padwatch_float32"'
        )
    floats = source.profile == "padwatch_float32"
    return CanShape(
        channels=tuple(
            DaqSignal(
                c.id,
                UNIT_OF[c.measurand] if floats else "V",
                1.0 if floats else c.scale["full_scale_v"] / COUNTS_FULL_SCALE,
            )
            for c in unit.channel
        ),
        slow=tuple(DaqSignal(slow.id, slow.unit) for slow in unit.slow_channel),
        fd=source.fd,
        floats=floats,
    )


def can_daq_of(
    unit: UnitSettings,
    source: settings.CanSettings,
    feed: SampleFeed,
    clock: Clock | None,
    *,
    patient: bool,
) -> DaqServer:
    """Build the simulated CAN DAQ that the source of a unit connects to.

    Parameters
    ----------
    feed
        Simulated samples that the device sends.
    clock
        Clock that paces the device; if None, the device produces samples as fast as they are read.
    patient
        Whether the device waits for a slow reader instead of losing samples.

    Raises
    ------
    ConfigError, LookupError
        If the source cannot be connected to a simulated DAQ.
    """
    device = CanDevice(feed, can_shape_of(unit, source), unit.id, block_samples=unit.block_samples)
    waiting: dict[str, Any] = {"on_demand": clock is None, "patient": patient}
    if source.interface != "slcan":
        return CanBusServer(
            device,
            clock,
            interface=source.interface,
            channel=source.channel,
            options=source.options,
            **waiting,
        )
    if source.channel == "pty" or source.channel.startswith("/"):
        link = None if source.channel == "pty" else Path(source.channel)
        return SlcanPtyServer(device, clock, link=link, **waiting)
    host, _, port = source.channel.removeprefix("socket://").rpartition(":")
    if not source.channel.startswith("socket://") or not port.isdecimal():
        raise LookupError(
            f"unit {unit.id}: a simulated DAQ cannot use channel {source.channel!r}; use"
            ' "socket://127.0.0.1:0", "pty" or the path of a link to a pty'
        )
    return SlcanTcpServer(device, clock, host=host, port=int(port), **waiting)


def require_dbc_fits(unit: UnitSettings) -> None:
    """Check the DBC file of a unit with a CAN source, without opening a bus.

    Raises `ConfigError` if the DBC file does not match the unit; the message names file and key.
    """
    if isinstance(unit.source, settings.CanSettings):
        compile_plan(can_settings_of(unit, unit.source), calibration_of(unit))
