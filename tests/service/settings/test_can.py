"""CAN sources in the plant file: what is allowed, and what is said of the rest."""

import pytest
from pydantic import ValidationError

from service.settings.can import CanSettings
from service.settings.response import FOLDER

PLAIN = {
    "kind": "can",
    "interface": "slcan",
    "channel": "/dev/ttyACM0",
    "bitrate": 500_000,
    "dbc": "daq.dbc",
    "signals": {"x": "WAVE.x", "y": ["WAVE.y0", "WAVE.y1"]},
    "slow": {"oil": "STATUS.oil"},
    "counters": ["WAVE.count", "STATUS.count"],
    "options": {"tty_baudrate": 2_000_000},
}
PROFILE = {
    "kind": "can",
    "interface": "slcan",
    "channel": "socket://127.0.0.1:0",
    "profile": "padwatch_int16",
}


def test_a_can_source_is_read_by_its_dbc_or_by_a_profile(tmp_path):
    source = CanSettings.model_validate(PLAIN, context={FOLDER: tmp_path})
    assert source.dbc_path == tmp_path / "daq.dbc"
    assert source.signals["y"] == ("WAVE.y0", "WAVE.y1")
    source.check_channels(["x", "y"], ["oil"])
    CanSettings.model_validate(PROFILE).check_channels(["any"], [])


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"dbc": None}, "dbc", "dbc or profile must be given, found neither"),
        ({"profile": "padwatch_int16"}, "dbc", "found both"),
        ({"signals": {}}, "signals", "must name a signal for each waveform channel"),
        ({"seconds": "T.s"}, "microseconds", "must be given together"),
        ({"microseconds": "T.us"}, "seconds", "must be given together"),
        ({"data_bitrate": 2_000_000}, "data_bitrate", "set fd = true"),
        ({"stamps": "interface"}, "stamps", 'must be "host": slcan has no time stamps'),
        ({"interface": "socketcan"}, "bitrate", "is set by the system here: ip link set"),
        (
            {"counter_counts": "frames", "frame_samples": ["W.n"]},
            "counter_counts",
            'needs "samples"',
        ),
    ],
)
def test_what_does_not_fit_is_refused_with_its_key(change, key, words):
    with pytest.raises(ValidationError, match=words) as refusal:
        CanSettings.model_validate(PLAIN | change)
    assert refusal.value.errors()[0]["ctx"]["error"].at == (key,)


OWN = ({"signals": {"x": "A.b"}}, {"counters": ["A.b"]}, {"epoch": "A.b"})


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (PLAIN | {"signals": {"x": "no dot"}}, "pattern"),
        (PLAIN | {"signals": {"x": "A.b c"}}, "pattern"),
        (PLAIN | {"signals": {"x": []}}, "at least 1"),
        (PLAIN | {"interface": "Slcan!"}, "pattern"),
        (PLAIN | {"bitrate": 7}, "greater than or equal"),
        (PLAIN | {"receive_buffer": 1}, "greater than or equal"),
        (PLAIN | {"hold_samples": 0}, "greater than or equal"),
        (PLAIN | {"when_full": "block"}, "drop"),
        (PLAIN | {"options": {"a b": 1}}, "pattern"),
        (PLAIN | {"stale_after": 3.0}, "Extra inputs"),
        *((PROFILE | own, "the profile knows its own") for own in OWN),
    ],
)
def test_a_wrong_value_is_refused(source, words):
    with pytest.raises(ValidationError, match=words):
        CanSettings.model_validate(source)


@pytest.mark.parametrize(
    ("channels", "slow", "words"),
    [
        (["x"], ["oil"], "no such channel; there are x"),
        (["x", "y", "z"], ["oil"], "has no signal for z"),
        (["x", "y"], [], "no such channel; there are none"),
        (["x", "y"], ["oil", "speed"], "has no signal for speed"),
    ],
)
def test_channels_and_signals_must_be_one_to_one(channels, slow, words):
    with pytest.raises(ValueError, match=words):
        CanSettings.model_validate(PLAIN).check_channels(channels, slow)
