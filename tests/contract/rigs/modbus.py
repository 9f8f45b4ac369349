"""Modbus sources on a counting plant."""

from contextlib import AsyncExitStack

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import TcpTransport
from acquisition.source import SampleSource


class ModbusRig:
    """A block ring on a real socket; the plant runs when told."""

    def __init__(self, feed, calibration, clock) -> None:  # noqa: ARG002 - sockets have their own
        self._device = RingDevice(feed)
        self._server = ModbusRingServer(self._device)
        self._calibration = calibration
        self._plug = AsyncExitStack()
        self.step_samples = self._device.layout.samples_per_slot
        self.source: SampleSource

    async def __aenter__(self) -> "ModbusRig":
        await self.plug_in()
        settings = ModbusRingSettings(
            transport=TcpTransport(host="127.0.0.1", port=self._server.port),
            poll_period_s=0.001,
            timeout_s=5.0,
        )
        self.source = ModbusRingSource(settings, self._calibration, SystemClock())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.pull()

    async def plug_in(self) -> None:
        await self._plug.enter_async_context(self._server)

    async def pull(self) -> None:
        await self._plug.aclose()

    def run(self, n_samples: int) -> None:
        self._device.produce(n_samples // self.step_samples)
