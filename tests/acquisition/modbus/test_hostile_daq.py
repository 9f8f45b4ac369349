"""A hostile DAQ: every kind of wrong reply, 200 random contents of each, and no false sample."""

import asyncio
import contextlib
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pymodbus.framer import FramerRTU
from rigs.hostile_modbus import HostileLine, HostileServer

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_shape import RingDeviceSettings
from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.modbus.transport import SerialTransport, TcpTransport

N_CONTENTS = 200
N_AT_ONCE = 20
TIMEOUT_S = 0.05
HANG_UP = object()
LATE = object()
"""What a lie may consist of beside bytes: closing the connection, or the time-out passing."""


class Words:
    """What a lie is made of: the exchange it falls into, and chance."""

    def __init__(self, request: bytes, reply: bytes, random: np.random.Generator) -> None:
        self.request, self.reply, self.random = request, reply, random

    def byte(self, *but: int) -> int:
        """Any byte but these."""
        value = int(self.random.integers(256))
        return value if value not in but else self.byte(*but)

    def some(self, at_most: int, at_least: int = 1) -> bytes:
        return self.random.bytes(int(self.random.integers(at_least, at_most + 1)))

    def cut(self) -> bytes:
        """The reply without its end."""
        return self.reply[: int(self.random.integers(1, len(self.reply)))]

    def changed(self, data: bytes, start: int = 0, stop: int | None = None) -> bytes:
        """Some bytes with one to four bits turned over."""
        wrong = bytearray(data)
        stop = len(data) if stop is None else stop
        for bit in self.random.choice(8 * (stop - start), self.random.integers(1, 5), False):
            wrong[start + bit // 8] ^= 1 << bit % 8
        return bytes(wrong)


def with_byte(position: int) -> Callable[[Words], list]:
    def lie(words: Words) -> list:
        wrong = bytearray(words.reply)
        wrong[position] = words.byte(wrong[position])
        return [bytes(wrong)]

    return lie


def tcp(words: Words, pdu: bytes, length: int | None = None) -> bytes:
    length = len(pdu) + 1 if length is None else length
    return words.request[:4] + struct.pack(">H", length) + words.request[6:7] + pdu


def rtu(_: Words, pdu: bytes, unit: int = 1) -> bytes:
    body = bytes([unit]) + pdu
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def of_length(words: Words, n_bytes: int, data: bytes) -> bytes:
    """Registers of a reply that has this many bytes, and says so."""
    data = (data + words.random.bytes(260))[: max(0, n_bytes)]
    return bytes([words.request[7], len(data) & 0xFF]) + data


COMMON = {
    "truncated, then silent": lambda w: [w.cut(), LATE],
    "truncated, then closed": lambda w: [w.cut(), HANG_UP],
    "garbage before the reply": lambda w: [w.some(600) + w.reply],
    "nothing but garbage": lambda w: [w.some(300)],
    "bytes after the reply": lambda w: [w.reply + w.some(300)],
    "the reply twice": lambda w: [w.reply, w.reply],
    "the reply twice at once": lambda w: [w.reply + w.reply],
    "its own request": lambda w: [w.request],
    "its own request, then the reply": lambda w: [w.request + w.reply],
    "silence": lambda _: [LATE],
    "the reply too late": lambda w: [LATE, w.reply],
    "hanging up": lambda _: [HANG_UP],
    "the reply backwards": lambda w: [w.reply[::-1]],
    "a few bits turned over": lambda w: [w.changed(w.reply)],
}

TCP = COMMON | {
    "another transaction": lambda w: [
        struct.pack(">H", (int.from_bytes(w.reply[:2]) + w.random.integers(1, 65_536)) % 65_536)
        + w.reply[2:]
    ],
    "the transaction before": lambda w: [
        struct.pack(">H", int.from_bytes(w.reply[:2], "big") - 1)
        + w.reply[2:9]
        + w.random.bytes(len(w.reply) - 9)
    ],
    "transaction zero": lambda w: [b"\0\0" + w.reply[2:9] + w.random.bytes(len(w.reply) - 9)],
    "another protocol": with_byte(3),
    "another unit": with_byte(6),
    "another function": with_byte(7),
    "another byte count": with_byte(8),
    "length zero": lambda w: [tcp(w, w.reply[7:], 0)],
    "another length": lambda w: [
        tcp(w, w.reply[7:], (len(w.reply) - 6 + int(w.random.integers(1, 65_536))) % 65_536)
    ],
    "length with its bytes exchanged": lambda w: [w.reply[:4] + w.reply[5:3:-1] + w.reply[6:]],
    "fewer registers": lambda w: [
        tcp(w, of_length(w, len(w.reply) - 9 - 2 * int(w.random.integers(1, 9)), w.reply[9:]))
    ],
    "more registers": lambda w: [
        tcp(w, of_length(w, len(w.reply) - 9 + 2 * int(w.random.integers(1, 9)), w.reply[9:]))
    ],
    "an odd number of bytes": lambda w: [
        tcp(w, of_length(w, len(w.reply) - 10 + 2 * int(w.random.integers(2)), w.reply[9:]))
    ],
    "an exception for another function": lambda w: [
        tcp(w, bytes([w.byte(0x83) | 0x80, w.byte()])) if w.byte() else b""
    ],
    "an exception and more": lambda w: [tcp(w, bytes([0x83, w.byte()]) + w.some(200))],
    "an exception cut short": lambda w: [tcp(w, b"\x83"), LATE],
    "an exception of any code": lambda w: [tcp(w, bytes([0x83, w.byte()]))],
    "random registers": lambda w: [w.reply[:9] + w.random.bytes(len(w.reply) - 9)],
    "registers that have changed on the way": lambda w: [w.changed(w.reply, 9)],
    "registers of another place": lambda w: [w.reply[:9] + w.reply[9:][::-1]],
    "words exchanged": lambda w: [
        w.reply[:9]
        + np.frombuffer(w.reply, ">u2", offset=9)
        .reshape(-1, 1 + len(w.reply[9:]) % 4 // 2)[::-1]
        .tobytes()
    ],
    "a banner": lambda w: [b"SSH-2.0-OpenSSH_" + w.some(30).hex().encode() + b"\r\n"],
}

RTU = COMMON | {
    "another unit": with_byte(0),
    "another function": with_byte(1),
    "another byte count": with_byte(2),
    "a wrong checksum": with_byte(-1),
    "checksum zero": lambda w: [w.reply[:-2] + b"\0\0"],
    "checksum with its bytes exchanged": lambda w: [w.reply[:-2] + w.reply[:-3:-1]],
    "another unit with a right checksum": lambda w: [rtu(w, w.reply[1:-2], w.byte(1))],
    "another function with a right checksum": lambda w: [
        rtu(w, bytes([w.byte(3, 0x83)]) + w.reply[2:-2])
    ],
    "fewer registers": lambda w: [rtu(w, bytes([3, max(0, w.reply[2] - 2)]) + w.reply[3:-4])],
    "more registers": lambda w: [rtu(w, bytes([3, w.reply[2] + 2]) + w.reply[3:-2] + w.some(2, 2))],
    "an odd number of bytes": lambda w: [rtu(w, bytes([3, w.reply[2] - 1]) + w.reply[3:-3])],
    "an exception for another function": lambda w: [
        rtu(w, bytes([w.byte(0x83, *range(128)), w.byte()]))
    ],
    "an exception and more": lambda w: [rtu(w, bytes([0x83, w.byte()]) + w.some(200))],
    "an exception of any code": lambda w: [rtu(w, bytes([0x83, w.byte()]))],
    "random registers with a right checksum": lambda w: [
        rtu(w, w.reply[1:3] + w.random.bytes(len(w.reply) - 5))
    ],
    "registers of another place": lambda w: [rtu(w, w.reply[1:3] + w.reply[3:-2][::-1])],
    "noise on the line": lambda w: [bytes([0xFF] * int(w.random.integers(1, 9))) + w.reply],
}


class Bench:
    """A device whose replies are true but for one lie in each trial, and a source that reads it."""

    def __init__(self, feed, calibration, seed: int) -> None:
        settings = RingDeviceSettings(n_slots=64)
        self.device = RingDevice(feed, settings=settings)
        self.n_told = 0
        self.blocks: list = []
        self._calibration = calibration
        self._random = np.random.default_rng(seed)

    async def try_lies(self, ear, transport, make: Callable[[Words], list], n_lies: int) -> None:
        """Let a lie fall into a random one of the first replies after each connection."""

        async def lie(request, reply, writer) -> None:
            ear.lie = None
            parts = make(Words(request, reply, self._random))
            self.n_told += 1
            self.device.produce(1)
            await _tell(parts, writer)

        settings = ModbusRingSettings(transport=transport, timeout_s=TIMEOUT_S, poll_period_s=0.001)
        source = ModbusRingSource(settings, self._calibration, SystemClock())
        while self.n_told < n_lies:
            ear.n_honest, ear.lie = int(self._random.integers(6)), lie
            self.device.produce(2)
            with contextlib.suppress(LinkError, ConfigError):
                await self._read(source, ear)
        while self._stop_index < self.device.ledger.n_samples("U1"):
            with contextlib.suppress(LinkError):
                await self._read(source, ear)

    @property
    def _stop_index(self) -> int:
        return self.blocks[-1].stop_index if self.blocks else 0

    async def _read(self, source, ear) -> None:
        async with source.connect() as stream:
            async for block in stream:
                self.blocks.append(block)
                if block.stop_index < self.device.ledger.n_samples("U1"):
                    continue
                if ear.lie is None:
                    return
                self.device.produce(1)


async def _tell(parts: list, writer) -> None:
    for part in parts:
        if part is HANG_UP:
            writer.close()
            return
        if part is LATE:
            await asyncio.sleep(1.5 * TIMEOUT_S)
        else:
            writer.write(part)
            await writer.drain()


def assert_nothing_false(bench: Bench) -> None:
    samples = np.concatenate([block.samples[0] for block in bench.blocks])
    index = np.concatenate([np.arange(b.first_index, b.stop_index) for b in bench.blocks])
    np.testing.assert_array_equal(samples, index % 2**15)
    stop = bench.device.ledger.n_samples("U1")
    np.testing.assert_array_equal(index, np.arange(bench.blocks[0].first_index, stop))
    assert len({block.epoch for block in bench.blocks}) == 1
    assert not any(block.rejected or block.stamp_fault for block in bench.blocks)
    assert all(block.slow["slow0"].value == 45.0 for block in bench.blocks)


@pytest.fixture
def benches(counting_feed, counts_calibration) -> list[Bench]:
    calibration = counts_calibration(n_channels=1)
    return [Bench(counting_feed(n_channels=1), calibration, seed) for seed in range(N_AT_ONCE)]


def test_there_are_more_than_two_dozen_kinds_of_wrong_reply():
    assert len(TCP) >= 24
    assert len(RTU) >= 24


@pytest.mark.parametrize("make", TCP.values(), ids=TCP.keys())
async def test_no_wrong_reply_over_tcp_becomes_a_sample(make, benches):
    async def try_on(bench: Bench) -> None:
        async with HostileServer(bench.device.memory) as server:
            transport = TcpTransport(host="127.0.0.1", port=server.port)
            await bench.try_lies(server, transport, make, N_CONTENTS // N_AT_ONCE)

    await asyncio.gather(*(try_on(bench) for bench in benches))
    assert sum(bench.n_told for bench in benches) >= N_CONTENTS
    for bench in benches:
        assert_nothing_false(bench)


@pytest.mark.parametrize("make", RTU.values(), ids=RTU.keys())
async def test_no_wrong_reply_on_a_line_becomes_a_sample(make, benches, tmp_path: Path):
    async def try_on(bench: Bench, path: Path) -> None:
        async with HostileLine(bench.device.memory, path) as line:
            transport = SerialTransport(device=str(path), baudrate=4_000_000, parity="none")
            await bench.try_lies(line, transport, make, N_CONTENTS // N_AT_ONCE)

    await asyncio.gather(*(try_on(b, tmp_path / str(n)) for n, b in enumerate(benches)))
    assert sum(bench.n_told for bench in benches) >= N_CONTENTS
    for bench in benches:
        assert_nothing_false(bench)
