"""`CanBusServer`: the simulated CAN DAQ on any bus that python-can can send to.

"virtual" stays within one process. "udp_multicast" reaches others on the same network: it leaves
by the route to its group, usually the default route, and slow readers lose frames.
"""

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any

import can

from acquisition.can.bus import foreign_errors_renamed
from acquisition.clock import Clock
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_faults import Item
from acquisition.simulated.devices.can_frames import FrameKind, WireFrame
from acquisition.simulated.devices.can_server import CanDaqServer

_BUS_OFF_ID = 0x40
_ERROR_ID = 0x88


class CanBusServer(CanDaqServer):
    """Serves one device on a bus.

    Parameters
    ----------
    interface, channel, options
        As python-can names them.
    """

    has_cable = False

    def __init__(
        self,
        device: CanDevice,
        clock: Clock | None = None,
        *,
        interface: str = "virtual",
        channel: str = "padwatch",
        on_demand: bool = False,
        patient: bool = False,
        options: Mapping[str, str | int | float | bool] | None = None,
    ) -> None:
        super().__init__(device, clock, on_demand, patient)
        self._interface = interface
        self._channel = channel
        self._options: dict[str, Any] = dict(options or {})
        self._bus: can.BusABC | None = None

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Where a reader finds it."""
        return {"interface": self._interface, "channel": self._channel}

    async def _plug_in(self) -> None:
        with foreign_errors_renamed(f"{self._interface} {self._channel}"):
            self._bus = can.Bus(
                channel=self._channel,
                interface=self._interface,
                ignore_config=True,
                **self._options,
            )

    async def _pull_out(self) -> None:
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    async def _send(self, items: Sequence[Item]) -> None:
        for item in items:
            if self._bus is not None and isinstance(item, WireFrame):
                with foreign_errors_renamed(f"{self._interface} {self._channel}"):
                    self._bus.send(_message(item))
        await asyncio.sleep(0)


def _message(frame: WireFrame) -> can.Message:
    if frame.kind is FrameKind.BUS_OFF or frame.kind is FrameKind.ERROR:
        bits = _BUS_OFF_ID if frame.kind is FrameKind.BUS_OFF else _ERROR_ID
        return can.Message(
            arbitration_id=bits, is_extended_id=False, is_error_frame=True, data=bytes(8)
        )
    return can.Message(
        arbitration_id=frame.frame_id,
        is_extended_id=frame.extended,
        is_remote_frame=frame.kind is FrameKind.REMOTE,
        is_fd=frame.fd,
        bitrate_switch=frame.fd,
        data=frame.data,
    )
