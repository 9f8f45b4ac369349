"""C9: only what is exactly a configured frame gets in, whatever looks like one."""

import ast
from collections import Counter
from pathlib import Path

import can
import numpy as np
import pytest

import acquisition.can
from acquisition.can.compiler import compile_plan
from acquisition.can.gate import FrameGate
from acquisition.can.settings import CanLinkSettings
from acquisition.daq.can_bus import _message
from acquisition.daq.can_dbc import daq_settings
from acquisition.daq.can_frames import FrameEncoder

N_EACH = 200


@pytest.fixture(params=[False, True], ids=["classic", "fd"])
def shape(request, shape_of):
    return shape_of(fd=request.param)


@pytest.fixture
def refused() -> Counter:
    return Counter()


@pytest.fixture
def gate(shape, counts_calibration, refused) -> FrameGate:
    link = CanLinkSettings(interface="virtual", channel="none")
    settings = daq_settings(shape, link, ("um",) * 4)
    return FrameGate(compile_plan(settings, counts_calibration(n_channels=4)), refused)


@pytest.fixture
def good(shape, counting_feed):
    return _message(FrameEncoder(shape).frames(counting_feed(n_channels=4).advance(50))[-1])


def other_length(message, random):
    return int(random.choice([n for n in range(65) if n != message.dlc]))


def another_length(message, random):
    length = other_length(message, random)
    return {"dlc": length, "data": random.bytes(length)}


CHANGES = {
    "remote": lambda *_: {"is_remote_frame": True, "data": b""},
    "remote with data": lambda *_: {"is_remote_frame": True},
    "other kind of id": lambda m, r: {"is_extended_id": True, "data": r.bytes(len(m.data))},
    "other kind of frame": lambda m, r: {"is_fd": not m.is_fd, "data": r.bytes(len(m.data))},
    "data shorter than it says": lambda m, r: {"data": r.bytes(int(r.integers(0, m.dlc)))},
    "data longer than it says": lambda m, r: {"data": r.bytes(m.dlc + int(r.integers(1, 60)))},
    "says another length": lambda m, r: {"dlc": other_length(m, r)},
    "another length": another_length,
    "error": lambda _, r: {"is_error_frame": True, "data": r.bytes(8)},
    "foreign": lambda _, r: {"arbitration_id": int(r.integers(0x200, 0x7FF))},
}
"""What is other than it should be in a frame."""

COUNTED_AS = {
    "remote": "remote_frame",
    "remote with data": "remote_frame",
    "other kind of id": "other_id_kind",
    "error": "error_frame",
    "foreign": "foreign_id",
}


@pytest.mark.parametrize("kind", CHANGES)
def test_two_hundred_of_each_kind_and_only_a_good_frame_gets_in(kind, gate, good, refused, shape):
    assert gate.admit(good) == (good.arbitration_id, bytes(good.data))
    assert refused == Counter()
    random = np.random.default_rng(20261121)
    for _ in range(N_EACH):
        message = can.Message(
            arbitration_id=good.arbitration_id,
            is_extended_id=False,
            is_fd=good.is_fd,
            data=bytes(good.data),
        )
        for name, value in CHANGES[kind](message, random).items():
            setattr(message, name, bytearray(value) if name == "data" else value)
        frame = gate.admit(message)
        assert frame is None or frame[1] is None
    other_frame = "classic_frame" if shape.fd else "fd_frame"
    usual = other_frame if kind == "other kind of frame" else "wrong_length"
    assert refused == {COUNTED_AS.get(kind, usual): N_EACH}


def test_no_code_of_the_adapter_can_send():
    """Padwatch listens only; the one thing it writes are an slcan adapter's open and close."""
    calls = {"send", "send_periodic", "_send_periodic_internal", "flush_tx_buffer"}
    for path in Path(acquisition.can.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not (isinstance(node, ast.Attribute) and node.attr in calls), path
