"""`ModbusServer`: a simulated Modbus device as fast as a clock says, whatever link it is on."""

import asyncio
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Mapping
from types import TracebackType
from typing import Protocol, Self

from acquisition.clock import Clock
from acquisition.simulated.devices.modbus_answers import (
    REPLY_FAULTS,
    ReadableDevice,
    ReplyFault,
    answer,
)

_ROUNDING = 1e-6
"""Of a step: a clock that wakes a rounding error too early must not be asked to sleep for it."""


class ModbusDevice(ReadableDevice, Protocol):
    """A device that a server can pace and spoil."""

    @property
    def step_s(self) -> float:
        """Time that one step of production covers."""
        ...

    @property
    def ended(self) -> bool:
        """Whether nothing new will be produced any more."""
        ...

    @property
    def drained(self) -> bool:
        """Whether it has ended and a reader has read all and looked again."""
        ...

    def produce(self, n_steps: int) -> None:
        """Let so much time pass."""
        ...

    def fault_names(self) -> list[str]:
        """Names of the faults of its data."""
        ...

    def spoil(self, fault: str, count: int) -> None:
        """Let one of these happen so many times."""
        ...


class ModbusServer(ABC):
    """Serves one device; enter it to listen, leave it to pull the plug, enter it again.

    Parameters
    ----------
    device
        Keeps its registers while nobody serves it.
    clock
        Paces the device, which catches up after any delay; without one the device stands until
        its ``produce`` is called.
    patient
        Whether the clock starts with the first request rather than when the server is entered.

    Attributes
    ----------
    function_codes
        How often each function code has arrived.
    """

    def __init__(
        self, device: ModbusDevice, clock: Clock | None = None, *, patient: bool = False
    ) -> None:
        self.function_codes: Counter[int] = Counter()
        self._asked = asyncio.Event()
        self._patient = patient
        self._served = device
        self._clock = clock
        self._origin_s: float | None = None
        self._n_paced = 1  # what was there from the start covers the first interval
        self._pacing: asyncio.Task[None] | None = None
        self._finished = asyncio.Event()
        self._reply_faults: deque[ReplyFault] = deque()

    @property
    @abstractmethod
    def endpoint(self) -> Mapping[str, str | int]:
        """Where a reader finds it: keys and values of the source's settings."""

    async def __aenter__(self) -> Self:
        await self._listen()
        if self._clock is not None:
            self._pacing = asyncio.create_task(self._pace(self._clock))
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._pacing is not None:
            self._pacing.cancel()
            await asyncio.wait([self._pacing])
        await self._stop_listening()

    async def run(self) -> None:
        """Serve until cancelled, or until the device's data have ended and nobody waits for them.

        Raises what stops the device.
        """
        if self._pacing is not None:
            await self._pacing
            self.finish_if_nobody_waits()
        await self._finished.wait()

    def inject(self, fault: str, count: int = 1) -> None:
        """Let the device do something wrong, so many slots or so many replies long.

        Raises
        ------
        LookupError
            If the fault is not known; the message lists those that are.
        """
        if fault in REPLY_FAULTS:
            self._reply_faults.extend([REPLY_FAULTS[fault]] * count)
            if fault == "cut":
                self._cut_now()
        elif fault in self._served.fault_names():
            self._served.spoil(fault, count)
        else:
            known = ", ".join(sorted([*REPLY_FAULTS, *self._served.fault_names()]))
            raise LookupError(f"no fault is called {fault}; known are {known}")

    @abstractmethod
    def cut(self) -> None:
        """Cut every connection, like a pulled cable that is plugged in again."""

    @abstractmethod
    async def _listen(self) -> None:
        """Begin to take requests.

        Raises
        ------
        LinkError
            If that is not possible.
        """

    @abstractmethod
    async def _stop_listening(self) -> None:
        """Close everything."""

    @abstractmethod
    def _n_connections(self) -> int:
        """Readers that are there now."""

    def reply(self, request: bytes) -> bytes | None:
        """Answer a request as the device does now; None for silence.

        Raises
        ------
        HangUpError
            If it hangs up instead.
        """
        self.function_codes[request[0]] += 1
        self._asked.set()
        if self._reply_faults:
            return self._reply_faults.popleft()(request, self._right_reply)
        return self._right_reply(request)

    def finish_if_nobody_waits(self) -> None:
        """Note the end of a paced device that no reader is connected to."""
        if self._clock is not None and self._served.ended and not self._n_connections():
            self._finished.set()

    def _right_reply(self, request: bytes) -> bytes:
        reply = answer(request, self._served)
        if self._served.drained:
            self._finished.set()
        return reply

    def _cut_now(self) -> None:
        """Spend one of the injected cuts on the connections that are idle."""
        if self._n_connections():
            self._reply_faults.pop()
            self.cut()

    async def _pace(self, clock: Clock) -> None:
        step_s = self._served.step_s
        if self._patient:
            await self._asked.wait()
        if self._origin_s is None:
            self._origin_s = clock.monotonic_s()
        while not self._served.ended:
            n_passed = int((clock.monotonic_s() - self._origin_s) / step_s + _ROUNDING)
            self._served.produce(n_passed - self._n_paced)
            self._n_paced = max(n_passed, self._n_paced)
            await clock.sleep(self._origin_s + (n_passed + 1) * step_s - clock.monotonic_s())
