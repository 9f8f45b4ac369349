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
from acquisition.daq.can_faults import FrameFaults
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


def remote(message, random):  # noqa: ARG001
    message.is_remote_frame = True
    message.data = bytearray()


def remote_with_data(message, random):  # noqa: ARG001
    message.is_remote_frame = True


def other_kind_of_id(message, random):
    message.is_extended_id = True
    message.data = bytearray(random.bytes(len(message.data)))


def other_kind_of_frame(message, random):
    message.is_fd = not message.is_fd
    message.data = bytearray(random.bytes(len(message.data)))


def data_shorter_than_it_says(message, random):
    message.data = bytearray(random.bytes(int(random.integers(0, message.dlc))))


def data_longer_than_it_says(message, random):
    message.data = bytearray(random.bytes(message.dlc + int(random.integers(1, 60))))


def says_another_length(message, random):
    message.dlc = int(random.choice([n for n in range(65) if n != message.dlc]))


def another_length(message, random):
    message.dlc = int(random.choice([n for n in range(65) if n != message.dlc]))
    message.data = bytearray(random.bytes(message.dlc))


def error(message, random):
    message.is_error_frame = True
    message.data = bytearray(random.bytes(8))


def foreign(message, random):
    message.arbitration_id = int(random.integers(0x200, 0x7FF))


KINDS = {
    remote: "remote_frame",
    remote_with_data: "remote_frame",
    other_kind_of_id: "other_id_kind",
    data_shorter_than_it_says: "wrong_length",
    data_longer_than_it_says: "wrong_length",
    says_another_length: "wrong_length",
    another_length: "wrong_length",
    error: "error_frame",
    foreign: "foreign_id",
    other_kind_of_frame: None,
}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_two_hundred_of_each_kind_and_none_gets_in(kind, gate, good, refused, shape):
    random = np.random.default_rng(20261121)
    for _ in range(N_EACH):
        message = can.Message(
            arbitration_id=good.arbitration_id,
            is_extended_id=False,
            is_fd=good.is_fd,
            data=bytes(good.data),
        )
        kind(message, random)
        frame = gate.admit(message)
        assert frame is None or frame[1] is None
    assert refused == {KINDS[kind] or ("classic_frame" if shape.fd else "fd_frame"): N_EACH}


def test_a_good_frame_gets_in(gate, good, refused):
    assert gate.admit(good) == (good.arbitration_id, bytes(good.data))
    assert refused == Counter()


def test_no_code_of_the_adapter_can_send():
    """Padwatch listens only; the one thing it writes are an slcan adapter's open and close."""
    calls = {"send", "send_periodic", "_send_periodic_internal", "flush_tx_buffer"}
    for path in Path(acquisition.can.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not (isinstance(node, ast.Attribute) and node.attr in calls), path


def test_a_fault_nobody_knows_is_refused_with_those_there_are():
    assert {"drop", "flood"} <= set(FrameFaults().known)
    assert "long_line" not in FrameFaults().known
