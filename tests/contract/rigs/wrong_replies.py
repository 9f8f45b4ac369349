"""Every kind of wrong reply that a Modbus device, or the way to it, can make; over TCP and RTU.

Those of `FORMS` differ from a right reply in their form, and have to be refused by every source.
Those of `CONTENTS` are right replies with other registers: only data that carry a checksum of their
own, as a block ring of version 2 does, can tell.
"""

import asyncio
import struct
from collections.abc import Callable

import numpy as np

from rigs.hostile_modbus import rtu_frame

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
