"""C2, C3: a line is exactly a frame, or it is refused."""

import os
import string
from collections.abc import Iterator

import can
import numpy as np
import pytest
import serial
from can.util import CAN_FD_DLC

from acquisition.can.slcan import SlcanBus
from acquisition.errors import FrameError
from acquisition.simulated.devices.can_frames import WireFrame
from acquisition.simulated.devices.can_slcan import slcan_line

N_KINDS = 200
IDS = (0x100, 0x123)
ALL_IDS = range(1 << 29)


class Wire:
    """A pseudo-terminal with a bus at one end."""

    def __init__(self, ids=ALL_IDS, answer: bytes = b"\r") -> None:
        self._master, self._slave = os.openpty()
        path = os.ttyname(self._slave)
        self.bus = SlcanBus(path, ids, listen_only=True, sleep_after_open=0.0)
        os.read(self._master, 100)
        os.set_blocking(self._master, False)
        self._early: list[can.Message] = []
        self.n_malformed = 0
        self.say(answer)

    def say(self, data: bytes) -> None:
        """Write all of it; a line that is full is read meanwhile."""
        while data:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                self._early = self.heard()

    def heard(self, n_expected: int = 0) -> list[can.Message]:
        """All that has come, waiting for as many as are expected."""
        messages, self._early = self._early, []
        while True:
            try:
                message = self.bus.recv(5.0 if len(messages) < n_expected else 0.01)
            except FrameError:
                self.n_malformed += 1
                continue
            if message is None:
                return messages
            messages.append(message)

    def close(self) -> None:
        self.bus.shutdown()
        os.close(self._master)
        os.close(self._slave)


@pytest.fixture
def wire() -> Iterator[Wire]:
    wire = Wire()
    yield wire
    wire.close()


def random_frame(random: np.random.Generator) -> WireFrame:
    fd, extended = bool(random.integers(2)), bool(random.integers(2))
    length = int(random.choice(CAN_FD_DLC if fd else CAN_FD_DLC[:9]))
    frame_id = int(random.integers(0, 1 << 29 if extended else 1 << 11))
    return WireFrame(frame_id, extended, fd, random.bytes(length))


def test_what_is_written_is_read(wire):
    random = np.random.default_rng(1)
    frames = [random_frame(random) for _ in range(300)]
    heard = []
    for frame in frames:
        line = slcan_line(frame)
        wire.say(line if random.integers(2) else line.replace(b"A", b"a").replace(b"C", b"c"))
        heard += wire.heard() if random.random() < 0.05 else []
    heard += wire.heard(len(frames) - len(heard))
    assert [(m.arbitration_id, m.is_extended_id, m.is_fd, m.dlc, bytes(m.data)) for m in heard] == [
        (f.frame_id, f.extended, f.fd, len(f.data), f.data) for f in frames
    ]
    assert wire.n_malformed == 0


def test_a_line_cut_anywhere_between_two_reads_is_one_line(wire):
    line = slcan_line(WireFrame(0x123, False, False, bytes(range(8))))
    for cut in range(1, len(line)):
        wire.say(line[:cut])
        assert wire.heard() == []
        wire.say(line[cut:])
        [message] = wire.heard(1)
        assert bytes(message.data) == bytes(range(8))


def put(line: bytes, place: int, choices: bytes, random: np.random.Generator) -> bytes:
    """The line with any of some bytes in a place."""
    return line[:place] + bytes([int(random.choice(list(choices)))]) + line[place + 1 :]


def anywhere(line: bytes, random: np.random.Generator) -> int:
    return int(random.integers(1, len(line) - 1))


NO_DIGITS = "".join(c for c in string.printable if c not in string.hexdigits + "\r\a").encode()
KINDS = {
    "non hex": lambda line, r: put(line, anywhere(line, r), NO_DIGITS, r),
    "not ascii": lambda line, r: put(line, anywhere(line, r) - 1, bytes(range(128, 256)), r),
    "truncated": lambda line, r: line[: anywhere(line, r)] + b"\r",
    "merged": lambda line, r: line[: anywhere(line, r)] + line,
    "too long": lambda line, r: line[:-1] + b"4E" * int(r.integers(1, 9)) + b"\r",
    "five kilobytes": lambda line, r: line[:5] + r.bytes(2500).hex().upper().encode() + b"\r",
    "wrong length code": lambda line, r: put(line, 4, b"01234567", r),
    "length above eight": lambda line, r: put(line, 4, b"9ABCDEFabcdef", r),
    "unknown letter": lambda line, r: put(line, 0, b"xXyYqQ1!", r),
    "odd digits": lambda line, _: line[:-2] + b"\r",
    "id too large": lambda line, r: put(line, 1, b"8F", r),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_malformed_line_never_becomes_a_frame_and_the_next_one_does(kind, wire):
    random = np.random.default_rng(20261121)
    good = slcan_line(WireFrame(0x123, False, False, b"\1\2\3\4\5\6\7\x08"))
    accepted = []
    for n in range(N_KINDS):
        line = slcan_line(WireFrame(0x100, False, False, random.bytes(8)))
        wire.say(KINDS[kind](line, random) + good)
        if n % 2:
            accepted += wire.heard(2)
    assert [bytes(m.data) for m in accepted] == [b"\1\2\3\4\5\6\7\x08"] * N_KINDS
    assert wire.n_malformed == N_KINDS


def test_answers_of_an_adapter_are_no_frames_and_no_errors(wire):
    wire.say(b"\r\a\rz\rZ\rV1013\rvABCD\rNA123\rF00\r")
    assert wire.heard() == []
    assert wire.n_malformed == 0


@pytest.mark.parametrize("tail", [b"D0000012300\r", b"b1230\r", b"t1230\r", b"sb256256\r"])
def test_joining_in_the_middle_of_a_line_gives_no_frame(tail):
    wire = Wire(answer=b"")
    wire.say(tail + b"t1001FF\r")
    assert [(m.arbitration_id, m.is_error_frame) for m in wire.heard(1)] == [(0x100, False)]
    assert wire.n_malformed == 0
    wire.close()


@pytest.mark.parametrize(
    ("line", "bits"),
    [
        *((b"sb256256\r", 0x40), (b"sp128000\r", 0x04), (b"e1o\r", 0x8C), (b"e2bc\r", 0x88)),
        *((line, None) for line in (b"sb25625\r", b"sx000000\r", b"e9bc\r", b"e3bc\r", b"s\r")),
    ],
)
def test_state_lines_become_error_frames_or_are_refused(line, bits, wire):
    wire.say(line)
    errors = [
        message.arbitration_id for message in wire.heard(bits is not None) if message.is_error_frame
    ]
    assert errors == ([bits] if bits else [])
    assert wire.n_malformed == (0 if bits else 1)


def test_only_wanted_ids_are_heard_standard_and_extended():
    wire = Wire(ids=IDS)
    wire.say(b"t1001AA\rt3001AA\rT000001231BB\rT100001231CC\rt1231DD\r")
    assert [bytes(m.data) for m in wire.heard(3)] == [b"\xaa", b"\xbb", b"\xdd"]
    wire.close()


def test_an_unplugged_adapter_is_an_error_of_python_can_and_leaves_no_port_open():
    wire = Wire()
    os.close(wire._master)
    os.close(wire._slave)
    with pytest.raises(can.CanOperationError):
        wire.bus.recv(1.0)
    with pytest.raises(can.CanError):
        wire.bus.shutdown()
    assert not wire.bus.serialPortOrig.is_open


def test_a_port_whose_commands_fail_is_not_left_open(monkeypatch):
    opened = []

    def fails(self, data):  # noqa: ARG001
        opened.append(self)
        raise serial.SerialTimeoutException("Write timeout")

    monkeypatch.setattr(serial.Serial, "write", fails)
    master, slave = os.openpty()
    with pytest.raises(can.CanInitializationError):
        SlcanBus(os.ttyname(slave), ALL_IDS, sleep_after_open=0.0)
    assert not opened[0].is_open
    os.close(master)
    os.close(slave)
