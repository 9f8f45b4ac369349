"""Every kind of wrong reply of a Modbus device or network, and all sources on a device that lies.

Wrong replies of `FORMS` differ from a right reply in their form, and have to be refused by every
source. Those of `CONTENTS` are right replies with other registers: only data that carry a checksum
of their own, as a block ring does, can tell.
"""

import asyncio
import contextlib
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from acquisition.errors import ConfigError, LinkError
from acquisition.simulated.devices.ring_device import RingDeviceSettings
from rigs.hostile_modbus import HostileLine, HostileServer, rtu_frame
from rigs.modbus import InFlightRig, ModbusRig, ModbusRtuRig
from rigs.registers import REGISTER_RIGS, ChannelFifoTcpRig, VectorTcpRig

TIMEOUT_S = 0.25
"""A right reply takes milliseconds; a busy machine may take a hundred."""

HANG_UP = object()
LATE = object()
"""What a lie may consist of beside bytes: closing the connection, or the time-out passing."""

FIFO = 0x18


class Words:
    """What a lie is made of: the exchange it falls into, and chance."""

    def __init__(self, request: bytes, reply: bytes, random: np.random.Generator, link: str):
        self.request, self.reply, self.random = request, reply, random
        self.is_tcp = link == "tcp"
        self.pdu_at = 7 if self.is_tcp else 1
        self.function = request[self.pdu_at]
        self.data_at = self.pdu_at + (5 if self.function == FIFO else 2)
        self.stop = len(reply) if self.is_tcp else len(reply) - 2
        self.pdu = reply[self.pdu_at : self.stop]
        self.pdu_head = reply[self.pdu_at : self.data_at]
        self.data = reply[self.data_at : self.stop]

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

    def frame(self, pdu: bytes, length: int | None = None) -> bytes:
        """A reply of the right form with this inside, or one that claims another length."""
        if not self.is_tcp:
            return rtu_frame(self.request, pdu)
        length = len(pdu) + 1 if length is None else length
        return self.request[:4] + struct.pack(">H", length) + self.request[6:7] + pdu

    def with_data(self, data: bytes) -> bytes:
        """Registers, and as many as it says."""
        if self.function == FIFO:
            head = struct.pack(">BHH", FIFO, (2 + len(data)) % 65_536, len(data) // 2)
        else:
            head = bytes([self.function, len(data) % 256])
        return self.frame(head + data)

    def longer(self, n_bytes: int) -> bytes:
        """So many bytes of data more, or fewer."""
        n_bytes = max(0, len(self.data) + n_bytes)
        return self.with_data((self.data + self.random.bytes(40))[:n_bytes])

    def refusal(self, more: bytes) -> bytes:
        return self.frame(bytes([self.function | 0x80]) + more)

    def any_data(self, head: bytes) -> bytes:
        """A reply over TCP that begins so, with any registers."""
        return head + self.reply[len(head) : self.data_at] + self.random.bytes(len(self.data))

    def transaction(self, ahead: int) -> bytes:
        return struct.pack(">H", (int.from_bytes(self.reply[:2], "big") + ahead) % 65_536)


def with_byte(position: int) -> Callable[[Words], list]:
    def lie(words: Words) -> list:
        wrong = bytearray(words.reply)
        wrong[position] = words.byte(wrong[position])
        return [bytes(wrong)]

    return lie


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
    "fewer registers": lambda w: [w.longer(-2 * int(w.random.integers(1, 9)))],
    "an odd number of bytes": lambda w: [w.longer(-1)],
    "an exception for another function": lambda w: [
        w.frame(bytes([w.byte(w.function | 0x80, *range(128)), w.byte()]))
    ],
    "an exception and more": lambda w: [w.refusal(bytes([w.byte()]) + w.some(200))],
    "an exception cut short": lambda w: [w.refusal(b"")[: None if w.is_tcp else -2], LATE],
    "an exception of any code": lambda w: [w.refusal(bytes([w.byte()]))],
}

TCP_FORMS = COMMON | {
    "another transaction": lambda w: [
        w.transaction(int(w.random.integers(1, 65_536))) + w.reply[2:]
    ],
    "the transaction before": lambda w: [w.any_data(w.transaction(-1))],
    "transaction zero": lambda w: [w.any_data(b"\0\0")],
    "another protocol": lambda w: [
        w.any_data(w.reply[:2] + w.random.bytes(1) + bytes([w.byte(0)]))
    ],
    "another unit": lambda w: [w.any_data(w.reply[:6] + bytes([w.byte(w.reply[6])]))],
    "another function": lambda w: [
        w.any_data(w.reply[:7] + bytes([w.byte(w.function, w.function | 0x80)]))
    ],
    "another byte count": with_byte(8),
    "length zero": lambda w: [w.frame(w.pdu, 0)],
    "another length": lambda w: [
        w.frame(w.pdu, (len(w.pdu) + 1 + int(w.random.integers(1, 65_536))) % 65_536)
    ],
    "length with its bytes exchanged": lambda w: [w.reply[:4] + w.reply[5:3:-1] + w.reply[6:]],
    "a banner": lambda w: [b"SSH-2.0-OpenSSH_" + w.some(30).hex().encode() + b"\r\n"],
}

RTU_FORMS = COMMON | {
    "a few bits turned over": lambda w: [w.changed(w.reply)],
    "another unit": with_byte(0),
    "another function": with_byte(1),
    "another byte count": with_byte(2),
    "a wrong checksum": with_byte(-1),
    "checksum zero": lambda w: [w.reply[:-2] + b"\0\0"],
    "checksum with its bytes exchanged": lambda w: [w.reply[:-2] + w.reply[:-3:-1]],
    "another unit with a right checksum": lambda w: [
        rtu_frame(bytes([w.byte(1)]), w.pdu_head + w.random.bytes(len(w.data)))
    ],
    "another function with a right checksum": lambda w: [
        w.frame(
            bytes([w.byte(w.function, w.function | 0x80)])
            + w.pdu_head[1:]
            + w.random.bytes(len(w.data))
        )
    ],
    "random registers": lambda w: [
        w.reply[: w.data_at] + w.random.bytes(len(w.data)) + w.reply[-2:]
    ],
    "noise on the line": lambda w: [bytes([0xFF] * int(w.random.integers(1, 9))) + w.reply],
}

OF_REGISTERS = {
    "more registers": lambda w: [w.longer(2 * int(w.random.integers(1, 9)))],
}
"""Forms of a reply whose length is known from its request; a queue's is not."""

OF_QUEUES = {
    "a count of more than 31": lambda w: [w.with_data(w.random.bytes(64))],
    "a count that is not that of its bytes": lambda w: [
        w.frame(w.pdu[:3] + struct.pack(">H", w.random.integers(32)) + w.data + b"\0\0")
    ],
}
"""Forms of a reply that tells its own length."""

TCP_CONTENTS = {
    "a few bits turned over": lambda w: [w.changed(w.reply)],
    "random registers": lambda w: [w.any_data(w.reply[:2])],
    "registers that have changed on the way": lambda w: [w.changed(w.reply, w.data_at)],
    "registers of another place": lambda w: [w.reply[: w.data_at] + w.data[::-1]],
    "words exchanged": lambda w: [
        w.reply[: w.data_at] + np.frombuffer(w.data, ">u2")[::-1].tobytes()
    ],
}

RTU_CONTENTS = {
    "random registers with a right checksum": lambda w: [w.with_data(w.random.bytes(len(w.data)))],
    "registers of another place": lambda w: [w.with_data(w.data[::-1])],
}

FORMS = {"tcp": TCP_FORMS, "rtu": RTU_FORMS}
CONTENTS = {"tcp": TCP_CONTENTS, "rtu": RTU_CONTENTS}


async def tell(parts: list, writer) -> None:
    for part in parts:
        if part is HANG_UP:
            writer.close()
            return
        if part is LATE:
            await asyncio.sleep(1.5 * TIMEOUT_S)
        else:
            writer.write(part)
            await writer.drain()


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


def _ring(rig: type) -> type:
    """A ring of which a slot takes more than one read."""
    return _kind(rig, shape=RingDeviceSettings(samples_per_slot=100))


_REGISTERS = ["polled", "polled", "vector", "vector", "queue", "queue", "queue for each channel"]
KINDS = {
    (kind.link, source): kind
    for source, kind in [
        *(("ring", _ring(rig)) for rig in (ModbusRig, ModbusRtuRig)),
        ("ring in flight", _ring(InFlightRig)),
        ("vector in flight", _kind(VectorTcpRig, requests_in_flight=6)),
        ("queues in flight", _kind(ChannelFifoTcpRig, requests_in_flight=6)),
        *zip(_REGISTERS, map(_kind, REGISTER_RIGS), strict=True),
    ]
}
"""Kinds of lying devices, by link and source."""


def lies_to(link: str, source: str) -> dict[str, Callable]:
    """Kinds of wrong replies that a source must not believe."""
    lies = FORMS[link] | (OF_QUEUES if source.startswith("queue") else OF_REGISTERS)
    return lies | CONTENTS[link] if source.startswith("ring") else lies


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
            self._rig.forget_stalls()
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
