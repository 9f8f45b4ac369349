"""The compiled layout reads what cantools reads, for any signal in any place."""

import cantools
import numpy as np
import pytest

from acquisition.can.dbc import load_dbc
from acquisition.can.layout import FrameLayout, byte_offset, scalar_reader
from acquisition.errors import FrameError

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
        columns = FrameLayout(message, signals).columns(frames)
        for row, data in enumerate(frames):
            expected = reference.get_message_by_name(name).decode(
                data, decode_choices=False, scaling=False
            )
            for signal in signals:
                found = columns[signal.name][row]
                np.testing.assert_equal(found, np.array(expected[signal.name], found.dtype))
                np.testing.assert_equal(scalar_reader(signal)(data), expected[signal.name])
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
