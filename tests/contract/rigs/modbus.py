"""Modbus sources on a counting plant."""

import tempfile
from contextlib import AsyncExitStack
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.daq.modbus_server import ModbusServer
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer, RtuRingServer
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from acquisition.source import SampleSource


class _RingRig:
    """A block ring on a real link; the plant runs when told."""

    absence: str

    def __init__(self, feed, calibration, clock) -> None:  # noqa: ARG002 - links have their own
        self._device = RingDevice(feed)
        self._calibration = calibration
        self._plug = AsyncExitStack()
        self._server: ModbusServer
        self.step_samples = self._device.layout.samples_per_slot
        self.source: SampleSource

    async def _plug_in_and_read(self, timeout_s: float, transport) -> None:
        await self.plug_in()
        settings = ModbusRingSettings(
            transport=transport(), poll_period_s=0.001, timeout_s=timeout_s
        )
        self.source = ModbusRingSource(settings, self._calibration, SystemClock())

    async def __aexit__(self, *_: object) -> None:
        await self.pull()

    async def plug_in(self) -> None:
        await self._plug.enter_async_context(self._server)

    async def pull(self) -> None:
        await self._plug.aclose()

    def run(self, n_samples: int) -> None:
        self._device.produce(n_samples // self.step_samples)


class ModbusRig(_RingRig):
    """A block ring over Modbus TCP."""

    absence = r"127\.0\.0\.1:\d+: Connection refused"

    async def __aenter__(self) -> "ModbusRig":
        self._server = ModbusRingServer(self._device)
        await self._plug_in_and_read(5.0, self._transport)
        return self

    def _transport(self) -> Transport:
        return TcpTransport(host="127.0.0.1", port=self._server.port)


class ModbusRtuRig(_RingRig):
    """A block ring over Modbus RTU; pulling the plug takes the line's device away."""

    absence = r"/line: No such file or directory"

    async def __aenter__(self) -> "ModbusRtuRig":
        self._folder = tempfile.TemporaryDirectory()
        self._server = RtuRingServer(self._device, link=Path(self._folder.name) / "line")
        await self._plug_in_and_read(0.3, self._transport)
        return self

    async def __aexit__(self, *_: object) -> None:
        await super().__aexit__()
        self._folder.cleanup()

    def _transport(self) -> Transport:
        return SerialTransport(
            device=str(self._server.endpoint["device"]), baudrate=230_400, parity="none"
        )
