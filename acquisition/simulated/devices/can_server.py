"""Base class of the servers of the simulated CAN DAQ, and server on a python-can bus."""

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
    """Base class of the servers that send the frames of one simulated CAN device.

    Parameters
    ----------
    clock
        Clock of the production of blocks; after a delay, overdue blocks are produced at once.
        Without a clock, blocks are produced only by ``produce`` or on demand.
    on_demand
        Whether, without a clock, a block is produced each time all previous blocks are sent.
    patient
        Whether, with a clock, production waits while no client is connected or the buffer is full,
        so that no block is lost. Otherwise the oldest blocks are lost.
    as_line
        Function that encodes a frame as a line of a text protocol; None without such a protocol.
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
        """Send frames and lines; wait while the client does not read them."""

    async def _listened_to(self) -> None:
        """Wait until a client is connected; return at once if the bus does not report clients."""

    async def run(self) -> None:
        """Serve until cancelled, or until the feed has ended and all blocks are sent."""
        await asyncio.gather(*(asyncio.shield(task) for task in self._tasks))

    def produce(self, n_blocks: int = 1) -> None:
        """Produce the next `n_blocks` blocks at once; needed only without a clock."""
        self.device.produce(n_blocks)
        self._awake.set()

    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        """Return the fault functions of waveform frames, of blocks and of the device, by name.

        Their argument is a count. ``freeze`` repeats the last block in place of `count` blocks;
        ``reset_epoch`` ignores the count and restarts the device once.
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
            await asyncio.sleep(0)  # other tasks must run even if the socket never blocks

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
        """If the server is patient, wait until a client is connected and the buffer is not full."""
        if not self._patient:
            return
        await self._listened_to()
        while self.device.is_full:
            self._taken.clear()
            await self._taken.wait()


class CanBusServer(CanDaqServer):
    """Server that sends the frames of one simulated CAN device on a python-can bus.

    The interface "virtual" is limited to one process. "udp_multicast" reaches other processes and
    hosts over the route to its group, usually the default route; slow readers lose frames. Without
    a clock, `on_demand` produces a block when all are sent; with one, `patient` waits for a client.

    Parameters
    ----------
    interface, channel
        Arguments of the same names of `can.Bus` of python-can.
    options
        Further keyword arguments of `can.Bus`.
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
        """Interface and channel of the python-can bus."""
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
    """Return the python-can message of a frame; an error message for error and bus-off frames."""
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
