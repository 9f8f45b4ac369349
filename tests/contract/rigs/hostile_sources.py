"""Every Modbus source on a device that lies, over TCP and on a serial line."""

import contextlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from rigs.hostile_modbus import HostileLine, HostileServer
from rigs.registers import (
    ChannelFifoTcpRig,
    FifoRtuRig,
    FifoTcpRig,
    OnRtu,
    OnTcp,
    PolledRtuRig,
    PolledTcpRig,
    Rig,
    VectorRtuRig,
    VectorTcpRig,
)
from rigs.wrong_replies import FIFO, FORMS, OF_QUEUES, OF_REGISTERS, TIMEOUT_S, Words, tell

MOST_HONEST = 5


class OnLyingTcp:
    link = "tcp"
    timeout_s = TIMEOUT_S

    def _serve(self, device) -> HostileServer:
        self.ear = HostileServer(device)
        return self.ear


class OnLyingRtu:
    link = "rtu"
    timeout_s = TIMEOUT_S

    def _serve(self, device) -> HostileLine:
        self.ear = HostileLine(device, Path(self._folder.name) / "line")
        return self.ear


class Ring1(Rig):
    """A block ring without checksums, of which a slot takes more than one read."""

    async def __aenter__(self) -> "Ring1":
        shape = RingDeviceSettings(samples_per_slot=80, version=1)
        self._device = RingDevice(self._feed, settings=shape)
        self.step_samples = shape.samples_per_slot
        self._server = self._serve(self._device)
        await self.plug_in()
        settings = ModbusRingSettings(
            transport=self._transport(), poll_period_s=0.001, timeout_s=self.timeout_s
        )
        self.source = ModbusRingSource(settings, self._calibration, SystemClock())
        return self

    def run(self, n_samples: int) -> None:
        self._device.produce(n_samples // self.step_samples)


def _kind(link: type, rig: type) -> type:
    return type(f"Lying{rig.__name__}", (link, rig), {})


KINDS = {
    ("tcp", "ring 1"): _kind(OnLyingTcp, type("Ring1Tcp", (OnTcp, Ring1), {})),
    ("rtu", "ring 1"): _kind(OnLyingRtu, type("Ring1Rtu", (OnRtu, Ring1), {})),
    ("tcp", "polled"): _kind(OnLyingTcp, PolledTcpRig),
    ("rtu", "polled"): _kind(OnLyingRtu, PolledRtuRig),
    ("tcp", "vector"): _kind(OnLyingTcp, VectorTcpRig),
    ("rtu", "vector"): _kind(OnLyingRtu, VectorRtuRig),
    ("tcp", "queue"): _kind(OnLyingTcp, FifoTcpRig),
    ("rtu", "queue"): _kind(OnLyingRtu, FifoRtuRig),
    ("tcp", "queue for each channel"): _kind(OnLyingTcp, ChannelFifoTcpRig),
}


def lies_to(link: str, source: str) -> dict[str, Callable]:
    """Kinds of wrong replies that a source must not believe."""
    return FORMS[link] | (OF_QUEUES if source.startswith("queue") else OF_REGISTERS)


class Trial:
    """One source that is lied to again and again."""

    def __init__(self, rig, seed: int) -> None:
        self._rig = rig
        self._random = np.random.default_rng(seed)
        self.n_told = 0
        self.blocks: list = []

    async def lie(self, make: Callable[[Words], list], n_lies: int) -> None:
        """Let a lie fall into a random one of the first replies after each connection."""
        ear = self._rig.ear

        async def lie(request, reply, writer) -> None:
            ear.lie = None
            self.n_told += 1
            await tell(make(Words(request, reply, self._random, self._rig.link)), writer)

        while self.n_told < n_lies:
            ear.n_honest, ear.lie = int(self._random.integers(MOST_HONEST)), lie
            with contextlib.suppress(LinkError, ConfigError):
                await self._read()
        n_read = len(self.blocks)
        while len(self.blocks) == n_read:  # a busy machine may be slower than the time-out
            with contextlib.suppress(LinkError):
                await self._read()

    async def _read(self) -> None:
        """Read on until the lie has been told, and a block more."""
        n_more = 2
        async with self._rig.source.connect() as stream:
            self._rig.run(self._rig.step_samples)
            async for block in stream:
                self.blocks.append(block)
                n_more -= self._rig.ear.lie is None
                if not n_more:
                    return
                self._rig.run(self._rig.step_samples)

    def assert_nothing_false(self) -> None:
        assert_all_true(self.blocks)
        pdu_at = 7 if self._rig.link == "tcp" else 1
        assert {request[pdu_at] for request in self._rig.ear.requests} <= {3, FIFO}


def assert_all_true(blocks: list) -> None:
    """Each sample is its own number, so that what is missing is missing in the index, too."""
    stop = 0
    for block in blocks:
        index = np.arange(block.first_index, block.stop_index)
        expected = (index + np.arange(len(block.samples))[:, np.newaxis]) % 2**15
        np.testing.assert_array_equal(block.samples, expected)
        assert block.first_index >= stop
        stop = block.stop_index
    assert len({block.epoch for block in blocks}) == 1
    assert not any(block.rejected or block.stamp_fault for block in blocks)
    assert {block.slow["slow0"].value for block in blocks} == {45.0}
