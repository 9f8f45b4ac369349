"""Servers of the simulated CAN DAQ: pace, faults and end; any bus that python-can can send to."""

import asyncio
from abc import abstractmethod
from collections.abc import Callable, Coroutine, Mapping, Sequence
from functools import partial
from typing import Any

import can

from acquisition.can.bus import foreign_errors_renamed
from acquisition.clock import Clock
from acquisition.simulated.devices.can_device import CanDevice, FrameFaults, Item
from acquisition.simulated.devices.can_frames import FrameKind, WireFrame
from acquisition.simulated.devices.server import DaqServer
from core.units import NS_PER_S

_BUS_OFF_ID = 0x40
_ERROR_ID = 0x88


class CanDaqServer(DaqServer):
    """Serves one CAN device.

    Parameters
    ----------
    clock
        Paces the device, which catches up after any delay; without one the device produces only
        when ``produce`` is called.
    on_demand
        Without a clock: produce as fast as the reader takes, without loss while it listens.
    patient
        With a clock: wait while no reader listens or the reader is behind, so that no block is
        lost; otherwise the oldest blocks are.
    as_line
        Writes a frame as text, on a text protocol.
    """

    def __init__(
        self,
        device: CanDevice,
        clock: Clock | None,
        on_demand: bool,
        patient: bool,
        as_line: Callable[[WireFrame], bytes] | None = None,
    ) -> None:
        super().__init__()
        self.device = device
        self._clock = clock
        self._on_demand = on_demand
        self._patient = patient
        self._origin_s: float | None = None
        self._frame_faults = FrameFaults(as_line)
        self._awake = asyncio.Event()
        self._taken = asyncio.Event()

    @abstractmethod
    async def _send(self, items: Sequence[Item]) -> None:
        """Put frames onto the bus, waiting as long as the reader does not take them."""

    async def _listened_to(self) -> None:
        """Wait until a reader listens."""

    async def run(self) -> None:
        """Serve until cancelled; return when the feed has ended and all of it is sent."""
        await asyncio.gather(*(asyncio.shield(task) for task in self._tasks))

    def produce(self, n_blocks: int = 1) -> None:
        """Let the device run for some blocks; needed only without a clock."""
        self.device.produce(n_blocks)
        self._awake.set()

    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        """Faults of the next waveform frames, of the next blocks, and of the device.

        ``freeze`` repeats blocks; ``reset_epoch`` restarts the device, whatever the count.
        """
        of_frames = {
            name: partial(self._frame_faults.inject, name) for name in self._frame_faults.known
        }
        device = self.device
        return {**of_frames, "freeze": device.freeze, "reset_epoch": lambda _: device.restart()}

    def _jobs(self) -> list[Coroutine[Any, Any, None]]:
        pacing = [] if self._clock is None else [self._pace(self._clock)]
        return [self._serve(), *pacing]

    async def _serve(self) -> None:
        while self.device.has_frames or not self.device.ended:
            await self._listened_to()
            if not self.device.has_frames:
                if self._on_demand:
                    self.device.produce()
                    continue
                self._awake.clear()
                await self._awake.wait()
                continue
            await self._send(self._frame_faults.applied(self.device.next_frames()))
            self._taken.set()
            await asyncio.sleep(0)  # a socket that never blocks would starve other tasks

    async def _pace(self, clock: Clock) -> None:
        if self._origin_s is None:
            await self._wait_for_reader()
            self._origin_s = clock.monotonic_s()
        while not self.device.ended:
            before_s = clock.monotonic_s()
            await self._wait_for_reader()
            self._origin_s += clock.monotonic_s() - before_s
            due_s = self._origin_s + self.device.elapsed_ns / NS_PER_S
            await clock.sleep(max(0.0, due_s - clock.monotonic_s()))
            self.produce()

    async def _wait_for_reader(self) -> None:
        """Wait until a reader listens and has room, if the server is patient."""
        if not self._patient:
            return
        await self._listened_to()
        while self.device.is_full:
            self._taken.clear()
            await self._taken.wait()


class CanBusServer(CanDaqServer):
    """Serves one device on a bus of python-can.

    "virtual" stays within one process. "udp_multicast" reaches other processes and hosts: it uses
    the route to its group, usually the default route, and slow readers lose frames.

    Parameters
    ----------
    interface, channel, options
        Those of python-can.
    """

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
        """Interface and channel."""
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
                    self._bus.send(can_message(item))
        await asyncio.sleep(0)


def can_message(frame: WireFrame) -> can.Message:
    """A frame as a message of python-can."""
    if frame.kind in (FrameKind.BUS_OFF, FrameKind.ERROR):
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
