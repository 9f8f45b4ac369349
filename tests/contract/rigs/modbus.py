"""Modbus sources on a counting plant: their links, and the block ring."""

import tempfile
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.ring_source import RingSettings, RingSource
from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from acquisition.simulated.devices.modbus_device import ModbusDevice
from acquisition.simulated.devices.modbus_links import ModbusRtuServer, ModbusTcpServer
from acquisition.simulated.devices.modbus_server import ModbusServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.source import SampleSource


def transport_of(server: ModbusServer) -> Transport:
    """A way to a server."""
    kind = TcpTransport if "port" in server.endpoint else SerialTransport
    return kind(**server.endpoint)


class Rig:
    """A device on a real link; pulling the plug takes the link away."""

    absence: str
    keeps = True
    requests_in_flight = 1
    n_kept = 0
    """Samples that have been offered, if the device keeps them all until they are read."""

    def __init__(self, feed, calibration, clock) -> None:
        self._feed, self._calibration, self._clock = feed, calibration, clock
        self._plug = AsyncExitStack()
        self._folder = tempfile.TemporaryDirectory()
        self._server: ModbusServer
        self.step_samples = 1
        self.source: SampleSource
        self.client: ModbusClient

    async def __aexit__(self, *_: object) -> None:
        await self.pull()
        self._folder.cleanup()

    async def plug_in(self) -> None:
        await self._plug.enter_async_context(self._server)

    async def pull(self) -> None:
        await self._plug.aclose()

    def forget_stalls(self) -> None:
        """Let the device have as many requests in flight again as at first."""
        self.client.requests_in_flight = self.requests_in_flight

    def _serve(self, device: ModbusDevice) -> ModbusServer:
        return ModbusTcpServer(device)

    def _transport(self) -> Transport:
        return transport_of(self._server)

    def _link(self) -> dict[str, Any]:
        names = ("timeout_s", "requests_in_flight")
        return {"transport": self._transport()} | {name: getattr(self, name) for name in names}


class OnTcp(Rig):
    absence = r"127\.0\.0\.1:\d+: Connection refused"
    timeout_s = 5.0


class OnRtu(Rig):
    absence = r"/line: No such file or directory"
    timeout_s = 1.5

    def _serve(self, device: ModbusDevice) -> ModbusServer:
        return ModbusRtuServer(device, link=Path(self._folder.name) / "line")

    def _transport(self) -> Transport:
        device = str(self._server.endpoint["device"])
        return SerialTransport(device=device, baudrate=4_000_000, parity="none")


class RingRig(Rig):
    """A block ring; the plant runs when `run` is called."""

    shape = RingDeviceSettings()

    async def __aenter__(self) -> "RingRig":
        self.device = RingDevice(self._feed, settings=self.shape)
        self.step_samples = self.shape.samples_per_slot
        self._server = self._serve(self.device)
        await self.plug_in()
        settings = RingSettings(**self._link(), poll_period_s=0.001)
        self.source = RingSource(settings, self._calibration, SystemClock())
        self.client = self.source._client
        return self

    @property
    def n_kept(self) -> int:
        return self.device.ledger.n_samples("U1")

    def run(self, n_samples: int) -> None:
        self.device.produce(n_samples // self.step_samples)


class ModbusRig(OnTcp, RingRig):
    """A block ring over Modbus TCP."""


class InFlightRig(ModbusRig):
    """The same, asked for much at once."""

    requests_in_flight = 6


class ModbusRtuRig(OnRtu, RingRig):
    """A block ring over Modbus RTU."""
