"""A DBC and settings that do not fit are refused before any frame, with file, key and fix."""

import dataclasses

import numpy as np
import pytest

from acquisition.can.compiler import compile_plan
from acquisition.can.dbc import load_dbc
from acquisition.can.settings import CanChannel, CanLinkSettings, CanSettings, CanSlowChannel
from acquisition.errors import ConfigError
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration

LINK = CanLinkSettings(interface="virtual", channel="none")
DBC = """VERSION ""
BU_: N
BO_ 256 WAVE: 8 N
 SG_ count : 0|16@1+ (1,0) [0|0] "" N
 SG_ x : 16|16@1- (0.00030517578125,0) [0|0] "V" N
 SG_ y : 32|16@1- (0.30517578125,0) [0|0] "mV" N
 SG_ z : 48|16@1- (1,0) [0|0] "" N
BO_ 257 OTHER: 8 N
 SG_ v : 0|32@1- (1,0) [0|0] "mm/s" N
 SG_ w : 32|16@1- (1,0) [0|0] "mils" N
 SG_ u : 48|16@1- (0.01,0) [0|0] "um" N
BO_ 258 SLOW: 8 N
 SG_ count : 0|16@1+ (1,0) [0|0] "" N
 SG_ oil : 16|16@1- (0.1,0) [0|0] "°C" N
 SG_ speed : 32|16@1+ (0.1,0) [0|0] "rpm" N
 SG_ bits : 48|8@1+ (1,0) [0|0] "" N
 SG_ signed : 56|8@1- (1,0) [0|0] "" N
SIG_VALTYPE_ 257 v : 1;
"""
VOLT = ChannelCalibration(10.0, 250.0, -10.0, 10.0)


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "daq.dbc"
    path.write_text(DBC, encoding="utf-8")
    return path


def channel(id_: str, signal: str, unit: str = "um") -> CanChannel:
    return CanChannel(id_, unit, tuple(signal.split()))


def compiled(dbc, *channels, calibration=VOLT, **others):
    settings = CanSettings(link=LINK, dbc=dbc, channels=channels, **others)
    slow = tuple(SlowCalibration(s.id, -1e9, 1e9) for s in settings.slow)
    return compile_plan(
        settings, UnitCalibration("U1", 600.0, (calibration,) * len(channels), slow)
    )


X, Y, Z = channel("x", "WAVE.x"), channel("y", "WAVE.y"), channel("z", "WAVE.z")


def test_volts_millivolts_and_bare_counts_are_counts(dbc):
    assert compiled(dbc, X, Y, Z).decoder.in_counts
    within_a_millionth = dataclasses.replace(VOLT, full_scale_v=10.0 * (1 + 0.9e-6))
    assert compiled(dbc, X, calibration=within_a_millionth).decoder.in_counts


def test_any_other_signal_makes_all_channels_engineering_units(dbc):
    decoder = compiled(dbc, X, channel("v", "OTHER.v", "mm/s"), channel("u", "OTHER.u")).decoder
    assert not decoder.in_counts
    wave = np.array([7, 16384, 0, 0], dtype="<i2").tobytes()
    other = np.array([1.5], dtype="<f4").tobytes() + np.array([0, 300], dtype="<i2").tobytes()
    samples = decoder.samples([[wave], [other]])
    assert samples.dtype == np.float32
    np.testing.assert_array_equal(samples[:, 0], np.float32([5.0 * 250.0, 1.5, 3.0]))


MISFITS = [
    ((channel("x", "WAVE.none"),), {}, r"signals.x = \"WAVE.none\": .* no signal none; .* count"),
    ((channel("x", "NONE.x"),), {}, r"unknown message NONE; the DBC file has WAVE, OTHER, SLOW"),
    ((channel("x", "WAVE"),), {}, r"no signal \(none given\)"),
    ((X, channel("y", "WAVE.x")), {}, r"signals.y = \"WAVE.x\": is already the signal of"),
    ((X, channel("y", "WAVE.y WAVE.z")), {}, r"signals.y: names 2 signals, but x has 1"),
    ((channel("x", "WAVE.x OTHER.u"),), {}, r"signals.x: all signals must be in one message"),
    ((channel("w", "OTHER.w"),), {}, r'OTHER.w has unit "mils" in the DBC .* expected "um", "µm"'),
    ((channel("u", "OTHER.u", "mm/s"),), {}, r'OTHER.u has unit "um" .* expected "mm/s", .*or mV'),
    ((X,), {"counters": ("WAVE.nix",)}, r"counters = \"WAVE.nix\": .*no signal nix"),
    ((X,), {"counters": ("WAVE.x",)}, r"counters = \"WAVE.x\": must be an unsigned integer"),
    ((X,), {"counters": ("WAVE.count", "WAVE.count")}, r"message WAVE has a second counter"),
    ((X,), {"counters": ("SLOW.count",)}, r"counters: message WAVE has no signal"),
    ((X, channel("u", "OTHER.u")), {"counters": ("WAVE.count",)}, r"message OTHER has no signal"),
    ((X,), {"frame_samples": ("WAVE.count",)}, r"frame_samples requires counters"),
    ((X,), {"ok_bits": "SLOW.signed"}, r"ok_bits = \"SLOW.signed\": must be an unsigned integer"),
    ((X,), {"epoch": "SLOW.nix"}, r"epoch = \"SLOW.nix\""),
    ((X,), {"epoch": "SLOW.bits", "counters": ("WAVE.count",)}, r"its message has no counter"),
    ((X,), {"hold_samples": "SLOW.nix"}, r"hold_samples = \"SLOW.nix\""),
    (
        (X,),
        {"slow": (CanSlowChannel("oil", "MW", "SLOW.oil"),)},
        r'slow.oil: SLOW.oil has unit "°C" in the DBC file, expected "MW"',
    ),
    (
        (X,),
        {"slow": tuple(CanSlowChannel(n, "degC", "SLOW.oil") for n in "ab")},
        r"slow.b = \"SLOW.oil\": is already the signal of slow.a",
    ),
    (
        (X,),
        {
            "counters": ("WAVE.count",),
            "frame_samples": ("WAVE.count",),
            "counter_counts": "frames",
        },
        r"frame_samples requires counters",
    ),
]


@pytest.mark.parametrize(("channels", "others", "words"), MISFITS, ids=[m[2][:40] for m in MISFITS])
def test_a_misfit_is_refused_with_file_key_and_fix(channels, others, words, dbc):
    with pytest.raises(ConfigError, match=words) as refusal:
        compiled(dbc, *channels, **others)
    assert str(refusal.value).startswith(f"{dbc}: ")


def test_samples_of_one_channel_with_different_factors_are_refused(dbc):
    dbc.write_text(DBC.replace("(0.30517578125,0)", "(0.31,0)"), encoding="utf-8")
    with pytest.raises(
        ConfigError, match=r"signals\.x: all signals of the channel must have the same factor"
    ):
        compiled(dbc, channel("x", "WAVE.x WAVE.y"))


@pytest.mark.parametrize("full_scale_v", [10.0001, 5.0, 12.0])
@pytest.mark.parametrize("signal", ["WAVE.x", "WAVE.y"])
def test_a_full_scale_that_differs_is_refused_with_both(full_scale_v, signal, dbc):
    calibration = dataclasses.replace(VOLT, full_scale_v=full_scale_v)
    with pytest.raises(
        ConfigError, match=rf"full_scale_v is {full_scale_v:g} .* corresponds to 10; correct"
    ):
        compiled(dbc, channel("x", signal), calibration=calibration)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "invalid DBC file"),
        ('VERSION ""\nBU_: N\n', "defines no message \\(lines that begin with BO_"),
        ("garbage {", "invalid DBC file"),
        (DBC.replace(" 257 ", " 256 "), r"WAVE and OTHER share the standard id 256 \(0x100\)"),
        (DBC.replace(" OTHER", " WAVE"), "two messages have the name WAVE"),
        (DBC.replace("SG_ y : 32", "SG_ y : 24"), "overlapping"),
        (DBC.replace("BO_ 256 WAVE: 8", "BO_ 256 WAVE: 4"), "does not fit"),
        (DBC.replace("BO_ 256", "BO_ 5000"), "more than 11 bits"),
        (
            DBC.replace("SG_ count", "SG_ count M")
            .replace("SG_ x ", "SG_ x m0M ")
            .replace("SG_ y ", "SG_ y m1 ")
            + "SG_MUL_VAL_ 256 y x 1-1;\nSG_MUL_VAL_ 256 x count 0-0;\n",
            "has nested multiplexing",
        ),
    ],
)
def test_a_dbc_that_is_wrong_is_refused_with_its_name(text, words, dbc):
    dbc.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words) as refusal:
        compiled(dbc, X)
    assert str(dbc) in str(refusal.value)


NESTED = """
BO_ 512 NESTED: 8 N
 SG_ inner m0M : 0|4@1+ (1,0) [0|0] "" N
 SG_ outer M : 4|4@1+ (1,0) [0|0] "" N
 SG_ y m1 : 8|8@1+ (1,0) [0|0] "um" N
"""
NESTED_RANGES = "SG_MUL_VAL_ 512 y inner 1-1;\nSG_MUL_VAL_ 512 inner outer 0-0;\n"


def test_an_unused_message_may_be_multiplexed_twice_over_but_not_by_billions_of_values(dbc):
    dbc.write_text(DBC + NESTED + NESTED_RANGES, encoding="utf-8")
    compiled(dbc, X)
    ranges = NESTED_RANGES.replace("1-1", "1-1, 3-4000000000")
    dbc.write_text(DBC + NESTED + ranges, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"at most 100000 values, got 3999999997"):
        compiled(dbc, X)


def test_a_file_that_is_missing_a_folder_or_huge_is_refused_without_reading_it_all(tmp_path):
    for path in (tmp_path / "none.dbc", tmp_path):
        with pytest.raises(ConfigError, match="dbc must be the path of a DBC file"):
            compiled(path, X)
    path = tmp_path / "huge.dbc"
    with path.open("wb") as file:
        file.truncate(10**10)
    with pytest.raises(ConfigError, match="larger than"):
        compiled(path, X)


def test_of_a_long_line_that_is_no_dbc_only_the_beginning_is_shown(tmp_path):
    path = tmp_path / "long.dbc"
    path.write_text("BO_ " + "x" * 1_000_000, encoding="utf-8")
    with pytest.raises(ConfigError) as refusal:
        compiled(path, X)
    assert len(str(refusal.value)) < 1000


def test_a_spoilt_dbc_is_either_read_or_refused(tmp_path):
    random = np.random.default_rng(20261121)
    path = tmp_path / "spoilt.dbc"
    n_refused = 0
    for _ in range(300):
        content = bytearray(DBC.encode())
        for _ in range(int(random.integers(1, 6))):
            place = int(random.integers(0, len(content)))
            kind = random.integers(3)
            if kind == 0:
                content[place] = int(random.integers(0, 256))
            elif kind == 1:
                del content[place : place + int(random.integers(1, 40))]
            else:
                content[place:place] = random.bytes(3)
        path.write_bytes(content)
        try:
            load_dbc(path)
        except ConfigError:
            n_refused += 1
    assert n_refused > 100


def test_a_dbc_in_the_windows_character_set_has_the_same_units(dbc):
    text = DBC.replace('"um"', '"µm"')
    found = []
    for encoding in ("utf-8", "cp1252"):
        dbc.write_bytes(text.encode(encoding))
        messages = load_dbc(dbc)
        found.append((messages["OTHER"].signals["u"].unit, messages["SLOW"].signals["oil"].unit))
    assert found == [("µm", "°C")] * 2
