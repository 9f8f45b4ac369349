"""Every Modbus source on a device that lies, over TCP and on a serial line."""

import asyncio
import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from rigs.hostile_modbus import HostileLine, HostileServer
from rigs.modbus import ModbusRig, ModbusRtuRig
from rigs.registers import REGISTER_RIGS
from rigs.wrong_replies import (
    CONTENTS,
    FIFO,
    FORMS,
    OF_QUEUES,
    OF_REGISTERS,
    TIMEOUT_S,
    Words,
    tell,
)

MAX_HONEST = 5
MAX_CONNECTIONS = 100
"""Several times as many as a trial needs where a busy machine outlasts some time-outs."""

PATIENCE_S = 60.0
"""For one connection, which ends by itself in seconds."""


class _Lying:
    link = "tcp"
    timeout_s = TIMEOUT_S

    def _serve(self, device) -> HostileServer | HostileLine:
        if self.link == "tcp":
            self.ear = HostileServer(device)
        else:
            self.ear = HostileLine(device, Path(self._folder.name) / "line")
        return self.ear


def _kind(rig: type, **more: object) -> type:
    link = "rtu" if "Rtu" in rig.__name__ else "tcp"
    return type(f"Lying{rig.__name__}", (_Lying, rig), {"link": link} | more)


def _ring(rig: type, version: int) -> type:
    """A ring of which a slot takes more than one read."""
    return _kind(rig, shape=RingDeviceSettings(samples_per_slot=100, version=version))


_REGISTERS = ["polled", "polled", "vector", "vector", "queue", "queue", "queue for each channel"]
KINDS = {
    (kind.link, source): kind
    for source, kind in [
        *((f"ring {n}", _ring(rig, n)) for n in (1, 2) for rig in (ModbusRig, ModbusRtuRig)),
        *zip(_REGISTERS, map(_kind, REGISTER_RIGS), strict=True),
    ]
}
"""Kinds of lying devices, by link and source."""


def lies_to(link: str, source: str) -> dict[str, Callable]:
    """Kinds of wrong replies that a source must not believe."""
    lies = FORMS[link] | (OF_QUEUES if source.startswith("queue") else OF_REGISTERS)
    return lies | CONTENTS[link] if source == "ring 2" else lies


class Trial:
    """One source that is lied to again and again."""

    def __init__(self, rig, seed: int) -> None:
        self._rig = rig
        self._random = np.random.default_rng(seed)
        self.n_told = self.n_refused = self.n_connections = 0
        self.blocks: list = []

    async def lie(self, make: Callable[[Words], list], n_lies: int) -> None:
        """Let a lie fall into a random one of the first replies after each connection."""
        ear = self._rig.ear

        async def lie(request, reply, writer) -> None:
            ear.lie = None
            self.n_told += 1
            await tell(make(Words(request, reply, self._random, self._rig.link)), writer)

        while self.n_told < n_lies:
            ear.n_honest, ear.lie = int(self._random.integers(MAX_HONEST)), lie
            try:
                await self._read()
            except (LinkError, ConfigError):
                self.n_refused += 1
        n_read = len(self.blocks)
        while len(self.blocks) == n_read:  # a busy machine may be slower than the time-out
            with contextlib.suppress(LinkError):
                await self._read()

    async def _read(self) -> None:
        """Read until the lie has been told, one block more, and what is kept for the reader."""
        self.n_connections += 1
        assert self.n_connections <= MAX_CONNECTIONS, f"{self.n_told} lies told, then no way on"
        n_more = 2
        async with asyncio.timeout(PATIENCE_S), self._rig.source.connect() as stream:
            self._rig.run(self._rig.step_samples)
            async for block in stream:
                self.blocks.append(block)
                n_more -= self._rig.ear.lie is None
                if block.stop_index < self._rig.n_kept:
                    continue
                if n_more <= 0:
                    return
                self._rig.run(self._rig.step_samples)

    def assert_nothing_false(self) -> None:
        assert_all_true(self.blocks, loses_nothing=self._rig.n_kept > 0)
        pdu_at = 7 if self._rig.link == "tcp" else 1
        assert {request[pdu_at] for request in self._rig.ear.requests} <= {3, FIFO}


def assert_all_true(blocks: list, loses_nothing: bool = False, may_reject: bool = False) -> None:
    """Each sample is its own number, so that what is missing is missing in the index, too.

    Parameters
    ----------
    loses_nothing
        Whether only samples may be missing that were rejected, and are counted as such.
    """
    stop = blocks[0].first_index
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        expected = (index + np.arange(len(block.samples))[:, np.newaxis]) % 2**15
        np.testing.assert_array_equal(block.samples, expected)
        n_rejected = sum(rejection.n_samples for rejection in block.rejected)
        n_missing = block.first_index - stop
        assert n_missing == n_rejected if loses_nothing else n_missing >= 0
        stop = block.stop_index
    assert len({block.epoch for block in blocks}) == 1
    assert may_reject or not any(block.rejected for block in blocks)
    assert not any(block.stamp_fault for block in blocks)
    assert {block.slow["slow0"].value for block in blocks} == {45.0}
