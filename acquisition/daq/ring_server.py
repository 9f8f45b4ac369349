"""A simulated device with a block ring, on a TCP port or on a serial line."""

from pathlib import Path

from acquisition.clock import Clock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.rtu_server import ModbusRtuServer
from acquisition.daq.tcp_server import ModbusTcpServer


class ModbusRingServer(ModbusTcpServer):
    """Serves a block ring over Modbus TCP.

    Parameters
    ----------
    on_demand
        Without a clock: whether the device produces just what its reader can follow.
    patient
        With a clock: whether the device waits for its reader, at first and before a restart.
    """

    def __init__(
        self,
        device: RingDevice,
        clock: Clock | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        on_demand: bool = False,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, host, port, patient=patient)
        self.device = device
        device.on_demand, device.patient = on_demand, patient


class RtuRingServer(ModbusRtuServer):
    """Serves a block ring over Modbus RTU, on a pseudo-terminal.

    Parameters
    ----------
    link
        Where the line is to be found, whatever number the system gives it.
    on_demand
        Without a clock: whether the device produces just what its reader can follow.
    patient
        With a clock: whether the device waits for its reader, at first and before a restart.
    """

    def __init__(
        self,
        device: RingDevice,
        clock: Clock | None = None,
        link: Path | None = None,
        *,
        on_demand: bool = False,
        patient: bool = False,
    ) -> None:
        super().__init__(device, clock, link, patient=patient)
        self.device = device
        device.on_demand, device.patient = on_demand, patient
