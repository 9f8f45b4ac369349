"""Base class of the servers of a simulated Modbus device, with injected reply faults."""

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
"""Tolerance in steps for a sleep that ends too early by a rounding error."""

_MAX_STEPS = 100
"""Most overdue steps at once, so that a computer that is too slow still answers requests."""


class ModbusServer(DaqServer):
    """Base class of the servers of one simulated Modbus device.

    Parameters
    ----------
    device
        Device, which keeps its registers when the server exits.
    clock
        Clock of the production of data; after a delay, overdue data are produced at once. Without
        a clock, data are produced only by ``device.produce``.
    patient
        Whether the production of data starts with the first request rather than on entering.

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
        self._n_paced = 1  # the initial data are those of the first interval
        self._finished = asyncio.Event()
        self._reply_faults: deque[ReplyFault] = deque()

    async def run(self) -> None:
        """Serve until cancelled, or until the feed has ended and its data are no longer needed.

        Data are no longer needed if a client has read all data or no client is connected.
        Raises the error of the device if one occurs.
        """
        for pacing in self._tasks:
            await pacing
            self.finish_without_readers()
        await self._finished.wait()

    @abstractmethod
    def cut(self) -> None:
        """Close all connections abruptly, like a brief interruption of the cable."""

    @abstractmethod
    def _n_connections(self) -> int:
        """Return the number of connected clients."""

    def reply(self, request: bytes) -> bytes | None:
        """Return the reply PDU to a request PDU, with the next fault applied; None for no reply.

        Raises HangUpError if the device closes the connection instead of replying.
        """
        self.function_codes[request[0]] += 1
        self._asked.set()
        if self._reply_faults:
            return self._reply_faults.popleft()(request, self._right_reply)
        return self._right_reply(request)

    def finish_without_readers(self) -> None:
        """End `run` if the feed of a paced device has ended and no client is connected."""
        if self._clock is not None and self._device.ended and not self._n_connections():
            self._finished.set()

    def _faults_by_name(self) -> Mapping[str, Callable[[int], None]]:
        of_replies = {name: partial(self._spoil_replies, name) for name in REPLY_FAULTS}
        return {**self._device.faults, **of_replies}

    def _jobs(self) -> list[Coroutine[Any, Any, None]]:
        return [] if self._clock is None else [self._pace(self._clock)]

    def _spoil_replies(self, fault: str, count: int) -> None:
        self._reply_faults.extend([REPLY_FAULTS[fault]] * count)
        if (
            fault == "cut" and self._n_connections()
        ):  # the first one immediately, also on idle connections
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
            n_steps = max(0, min(n_passed - self._n_paced, _MAX_STEPS))
            self._device.produce(n_steps)
            self._n_paced += n_steps
            due_s = self._origin_s + (min(n_passed, self._n_paced) + 1) * step_s
            await clock.sleep(max(0.0, due_s - clock.monotonic_s()))
