"""`CanDaqServer`: what all ways to serve a simulated CAN DAQ share: pace, faults, the end."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Any, Self

import can

from acquisition.can.bus import foreign_errors_renamed
from acquisition.clock import Clock
from acquisition.simulated.devices.can_device import CanDevice, FrameFaults, Item
from acquisition.simulated.devices.can_frames import FrameKind, WireFrame
from core.units import NS_PER_S


class CanDaqServer:
    """Serves one device; enter it to plug it in, leave it to pull it out, enter it again.

    Parameters
    ----------
    clock
        Paces the device, which catches up after any delay; without one the device stands until
        its ``produce`` is called and `wake` after it.
    on_demand
        Without a clock: produce as fast as the reader takes; nothing is lost while one listens.
    patient
        With a clock: wait while nobody listens, or while the reader is behind, so that nothing is
        lost; else the oldest blocks are.
    as_line
        How frames are written as text, if they are.

    Attributes
    ----------
    has_cable
        Whether there is a connection that can be cut.
    """

    has_cable = True

    def __init__(
        self,
        device: CanDevice,
        clock: Clock | None,
        on_demand: bool,
        patient: bool,
        as_line: Callable[[WireFrame], bytes] | None = None,
    ) -> None:
        self.device = device
        self._clock = clock
        self._on_demand = on_demand
        self._patient = patient
        self._origin_s: float | None = None
        self._faults = FrameFaults(as_line)
        self._tasks: list[asyncio.Task[None]] = []
        self._awake = asyncio.Event()
        self._taken = asyncio.Event()

    @property
    def endpoint(self) -> Mapping[str, str | int]:
        """Where a reader finds it."""
        raise NotImplementedError

    async def _plug_in(self) -> None:
        raise NotImplementedError

    async def _pull_out(self) -> None:
        raise NotImplementedError

    async def _send(self, items: Sequence[Item]) -> None:
        """Put frames onto the bus, waiting as long as the reader does not take them."""
        raise NotImplementedError

    async def _listened_to(self) -> None:
        """Wait until somebody listens."""

    def cut(self) -> None:
        """Cut the connection, like a pulled cable that is plugged in again."""
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        await self._plug_in()
        self._tasks = [asyncio.create_task(self._serve(), name="can daq server")]
        if self._clock is not None:
            pace = self._pace(self._clock)
            self._tasks.append(asyncio.create_task(pace, name="can daq server pace"))
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.wait(self._tasks)
        await self._pull_out()

    async def run(self) -> None:
        """Serve until cancelled; return when the feed has ended and all of it is sent."""
        await asyncio.gather(*(asyncio.shield(task) for task in self._tasks))

    def produce(self, n_blocks: int = 1) -> None:
        """Let the device run for some blocks, where no clock paces it."""
        self.device.produce(n_blocks)
        self._awake.set()

    def inject(self, fault: str, count: int = 1) -> None:
        """Let the device, or the bus, do something wrong so many times.

        ``drop``, ``repeat``, ``reorder``, ``wrong_dlc``, ``error_frame``, ``flood``, ``rtr``,
        ``extended_twin``, ``bus_off`` and, on slcan, ``non_hex_line``, ``long_line`` and
        ``truncated_line`` meet the next waveform frames; ``freeze`` the next blocks;
        ``reset_epoch`` restarts the device, ``cut`` cuts the connection, where there is one.

        Raises
        ------
        LookupError
            If there is no such fault here; the message lists those there are.
        """
        if fault in self._faults.known:
            self._faults.inject(fault, count)
        elif fault == "freeze":
            self.device.frozen += count
        elif fault == "reset_epoch":
            self.device.restart()
        elif fault == "cut" and self.has_cable:
            self.cut()
        else:
            known = [*self._faults.known, "freeze", "reset_epoch", *["cut"] * self.has_cable]
            raise LookupError(f"no fault {fault!r}; there are {', '.join(sorted(known))}")

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
            await self._send(self._faults.applied(self.device.next_frames()))
            self._taken.set()
            await asyncio.sleep(0)  # a socket that takes everything would never let others in

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
        """Let a recording wait until somebody takes it; a machine waits for nobody."""
        if not self._patient:
            return
        await self._listened_to()
        while self.device.is_full:
            self._taken.clear()
            await self._taken.wait()


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
