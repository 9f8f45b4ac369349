"""The compiled layout reads what cantools reads, in any place and in multiplexed messages."""

import cantools
import numpy as np
import pytest

from acquisition.can.dbc import load_dbc
from acquisition.can.layout import byte_offset, column_reader, scalar_reader
from acquisition.errors import ConfigError, FrameError
from core.samples.blocks import Rejection

N_FRAMES = 20


def random_message(random: np.random.Generator, number: int) -> str:
    """A message whose signals lie anywhere, in either order, without overlap."""
    length = int(random.choice([1, 2, 3, 5, 8, 12, 24, 48, 64]))
    lines = [f"BO_ {100 + number} M{number}: {length} N\n"]
    bit = int(random.integers(0, 3))
    while bit < 8 * length:
        n_bits = int(random.choice([1, 3, 8, 8, 11, 16, 16, 16, 24, 32, 32, 64]))
        if random.random() < 0.5:
            bit = -(-bit // 8) * 8
        if bit + n_bits > 8 * length:
            break
        name = f"s{len(lines)}"
        if bit % 8 == 0 and random.random() < 0.5:
            start, order = bit + 7, 0
            if n_bits % 8:
                n_bits = -(-n_bits // 8) * 8
        else:
            start, order = bit, 1
        if bit + n_bits > 8 * length:
            break
        sign = random.choice(["+", "-"])
        lines.append(f' SG_ {name} : {start}|{n_bits}@{order}{sign} (1,0) [0|0] "V" N\n')
        if sign == "-" and n_bits == 32 and random.random() < 0.5:
            lines.append(f"@{name}")
        bit += n_bits + int(random.integers(0, 9))
    floats = [line[1:] for line in lines if line.startswith("@")]
    text = "".join(line for line in lines if not line.startswith("@"))
    return text + "".join(f"\0SIG_VALTYPE_ {100 + number} {name} : 1;\n" for name in floats)


def test_any_signal_in_any_place_is_read_as_cantools_reads_it(tmp_path):
    random = np.random.default_rng(20261121)
    texts = [random_message(random, n) for n in range(80)]
    tails = "".join(part for text in texts for part in text.split("\0")[1:])
    dbc = tmp_path / "random.dbc"
    dbc.write_text('VERSION ""\nBU_: N\n' + "".join(t.split("\0")[0] for t in texts) + tails)
    messages = load_dbc(dbc)
    reference = cantools.database.load_file(dbc)
    n_aligned = n_other = 0
    for name, message in messages.items():
        signals = list(message.signals.values())
        frames = [random.bytes(message.length) for _ in range(N_FRAMES)]
        columns = [column_reader(signal)(b"".join(frames)) for signal in signals]
        for row, data in enumerate(frames):
            expected = reference.get_message_by_name(name).decode(
                data, decode_choices=False, scaling=False
            )
            for signal, column in zip(signals, columns, strict=True):
                value = expected[signal.source.name]
                np.testing.assert_equal(column[row], np.array(value, column.dtype))
                np.testing.assert_equal(scalar_reader(signal)(data), value)
        n_aligned += sum(byte_offset(s) is not None for s in signals)
        n_other += sum(byte_offset(s) is None for s in signals)
    assert n_aligned > 100
    assert n_other > 50


def test_a_multiplexed_message_cannot_be_read_at_a_value_it_does_not_have(tmp_path):
    dbc = tmp_path / "mux.dbc"
    dbc.write_text(
        'VERSION ""\nBU_: N\nBO_ 100 M: 8 N\n SG_ which M : 0|3@1+ (1,0) [0|0] "" N\n'
        ' SG_ a m0 : 9|7@1+ (1,0) [0|0] "" N\n SG_ b m1 : 9|7@1+ (1,0) [0|0] "" N\n'
    )
    message = load_dbc(dbc)["M"]
    read = scalar_reader(message.signals["b"])
    assert read(b"\1\x0e" + bytes(6)) == 7
    with pytest.raises(FrameError, match="M"):
        read(b"\0\x0e" + bytes(6))
    with pytest.raises(FrameError, match="M"):
        read(b"\5\x0e" + bytes(6))


START_NS = 1_767_225_600_000_000_000
DBC = """VERSION ""
BU_: N
BO_ 300 M: 8 N
 SG_ which M : 0|4@1+ (1,0) [0|0] "" N
 SG_ count : 4|12@1+ (1,0) [0|0] "" N
 SG_ a m0 : 16|16@1- (1,0) [0|0] "V" N
 SG_ b m0 : 32|16@1- (1,0) [0|0] "V" N
 SG_ c m1 : 16|16@1- (1,0) [0|0] "V" N
 SG_ d m1 : 39|16@0- (1,0) [0|0] "V" N
 SG_ e m2 : 16|16@1- (1,0) [0|0] "V" N
"""


def frame(which: int, count: int, *words: int):
    head = (which | count % 4096 << 4).to_bytes(2, "little")
    body = b"".join((w % 2**15).to_bytes(2, "little") for w in words)
    return 300, (head + body).ljust(8, b"\0")


def instant(number: int):
    d = (number + 3) % 2**15
    swapped = (d & 0xFF) << 8 | d >> 8
    return [
        frame(0, number, number, number + 1),
        frame(1, number, number + 2, swapped) if swapped < 2**15 else _raw(number, d),
        frame(7, number, 99),
    ]


def _raw(number: int, d: int):
    key, data = frame(1, number, number + 2, 0)
    return key, data[:4] + d.to_bytes(2, "big") + data[6:]


@pytest.fixture
def assembler_with(settings_of, assembler_by):
    """Builds the assembler of four channels with some counters."""
    signals = {n: f"M.{n}" for n in "abcd"}
    return lambda counters: assembler_by(settings_of(DBC, signals, counters=counters))


@pytest.mark.parametrize("counters", [("M.count",), ()], ids=["counted", "uncounted"])
def test_the_parts_of_an_instant_are_put_together(counters, assembler_with):
    assembler = assembler_with(counters)
    blocks = []
    for first in range(0, 9000, 30):
        frames = [f for n in range(first, first + 30) for f in instant(n)]
        blocks += assembler.take(frames, START_NS + round((first + 30) / 600 * 1e9))
    samples = np.concatenate([block.counts for block in blocks], axis=1)
    expected = (np.arange(9000) + np.arange(4)[:, np.newaxis]) % 2**15
    np.testing.assert_array_equal(samples, expected)
    assert blocks[-1].stop_index == 9000


def test_a_lost_part_drops_the_instant(assembler_with):
    assembler = assembler_with(("M.count",))
    frames = [f for n in range(10) for f in (instant(n)[:1] if n == 4 else instant(n))]
    blocks = assembler.take(frames, START_NS)
    assert [(b.first_index, b.stop_index) for b in blocks] == [(0, 4), (5, 10)]
    assert blocks[1].rejected == (Rejection("incomplete_frames", 1),)


@pytest.mark.parametrize(
    ("signals", "words"),
    [
        ("M.a M.c", "all signals must be in one message"),
        ("M.count", "must be multiplexed like the other signals"),
    ],
)
def test_a_channel_has_samples_of_one_part(signals, words, settings_of, assembler_by):
    with pytest.raises(ConfigError, match=words):
        assembler_by(settings_of(DBC, {"a": signals}))
