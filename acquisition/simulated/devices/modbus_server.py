"""`ModbusServer`: paces and serves a simulated Modbus device, on any link."""

import asyncio
from abc import abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from typing import Any

from acquisition.clock import Clock
from acquisition.simulated.devices.modbus_device import (
    REPLY_FAULTS,
    ModbusDevice,
    ReplyFault,
    answer,
)
from acquisition.simulated.devices.server import DaqServer

_ROUNDING = 1e-6
"""Tolerance in steps: a clock that wakes a rounding error early is not made to sleep for it."""


class ModbusServer(DaqServer):
    """Serves one device.

    Parameters
    ----------
    device
        Keeps its registers while it is not served.
    clock
        Paces the device, which catches up after any delay; without one the device produces only
        when its ``produce`` is called.
    patient
        Whether the clock starts with the first request rather than on entering.

    Attributes
    ----------
    function_codes
        Number of requests by function code.
    """

    def __init__(
        self, device: ModbusDevice, clock: Clock | None = None, *, patient: bool = False
    ) -> None:
        super().__init__()
        self.function_codes: Counter[int] = Counter()
        self._asked = asyncio.Event()
        self._patient = patient
        self._device = device
        self._clock = clock
        self._origin_s: float | None = None
        self._n_paced = 1  # the data of the start cover the first interval
        self._finished = asyncio.Event()
        self._reply_faults: deque[ReplyFault] = deque()

    async def run(self) -> None:
        """Serve until cancelled, or until the feed has ended and no reader waits for data.

        Raises what stops the device.
        """
        for pacing in self._tasks:
            await pacing
            self.finish_without_readers()
        await self._finished.wait()

    @abstractmethod
    def cut(self) -> None:
        """Close every connection, as a cable does that is unplugged for a moment."""

    @abstractmethod
    def _n_connections(self) -> int:
        """Number of connected readers."""

    def reply(self, request: bytes) -> bytes | None:
        """Answer a request; None for silence.

        Raises
        ------
        HangUpError
            If the device closes the connection instead.
        """
        self.function_codes[request[0]] += 1
        self._asked.set()
        if self._reply_faults:
            return self._reply_faults.popleft()(request, self._right_reply)
        return self._right_reply(request)

    def finish_without_readers(self) -> None:
        """Finish if the feed of a paced device has ended and no reader is connected."""
        if self._clock is not None and self._device.ended and not self._n_connections():
            self._finished.set()

    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        of_replies = {name: partial(self._spoil_replies, name) for name in REPLY_FAULTS}
        return {**self._device.faults, **of_replies}

    def _jobs(self) -> list[Coroutine[Any, Any, None]]:
        return [] if self._clock is None else [self._pace(self._clock)]

    def _spoil_replies(self, fault: str, count: int) -> None:
        self._reply_faults.extend([REPLY_FAULTS[fault]] * count)
        if fault == "cut" and self._n_connections():  # one of them at once, on idle connections
            self._reply_faults.pop()
            self.cut()

    def _right_reply(self, request: bytes) -> bytes:
        reply = answer(request, self._device)
        if self._device.drained:
            self._finished.set()
        return reply

    async def _pace(self, clock: Clock) -> None:
        step_s = self._device.step_s
        if self._patient:
            await self._asked.wait()
        if self._origin_s is None:
            self._origin_s = clock.monotonic_s()
        while not self._device.ended:
            n_passed = int((clock.monotonic_s() - self._origin_s) / step_s + _ROUNDING)
            self._device.produce(n_passed - self._n_paced)
            self._n_paced = max(n_passed, self._n_paced)
            await clock.sleep(self._origin_s + (n_passed + 1) * step_s - clock.monotonic_s())
