"""Sources in the plant file: what can never work is refused at load."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from acquisition.modbus.transport import ExpectedRegisters, Identification
from core.spectra.polls import VectorPart, VectorRow
from service.settings.adapter_values import identity_of
from service.settings.base import MisfitError
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusVectorSettings,
    SlowDeviceSettings,
)
from service.settings.sources.modbus import IdentitySettings
from service.settings.transducers import FOLDER

DEPLOY = Path(__file__).parents[3] / "deploy"
SKF = "maps/vector-rack-skf-like.toml"
IDS = ("ujb_shaft_x", "ujb_shaft_y", "ujb_bearing_x", "ujb_bearing_y")
WAVES = {"value": [{"channel": id_, "address": 10 * n} for n, id_ in enumerate(IDS)]}


RIGHT = {
    ModbusPolledSettings: {"kind": "modbus_polled", "map": WAVES, "poll_period_s": 0.05},
    ModbusVectorSettings: {"kind": "modbus_vector", "map_file": SKF, "poll_period_s": 5.0},
    ModbusFifoSettings: {"kind": "modbus_fifo", "addresses": [1000]},
    SlowDeviceSettings: {"map_file": "maps/slow-gateway.toml", "poll_period_s": 1.0},
}


def load(model, **settings: Any):
    """Settings that work, changed."""
    given = {"host": "192.0.2.1"} | RIGHT[model] | settings
    return model.model_validate(given, context={FOLDER: DEPLOY})


polled, vector, fifo, slow_device = (partial(load, model) for model in RIGHT)


def test_a_polled_source_gives_a_value_for_every_channel():
    source = polled()

    source.require_fit(IDS, ("speed",))
    assert source.rate_hz == 20.0
    assert source.registers.ids == IDS
    with pytest.raises(MisfitError, match="no value for channel 'ljb_shaft_x'") as refusal:
        source.require_fit((*IDS, "ljb_shaft_x"), ())
    assert refusal.value.at == ("source", "map")
    with pytest.raises(MisfitError, match="unknown channel 'ujb_bearing_y'") as refusal:
        source.require_fit(IDS[:3], ())
    assert refusal.value.at == ("source", "map", "value", 3, "channel")


def test_a_rack_gives_the_amplitude_of_every_channel():
    source = vector()

    source.require_fit(IDS, ("speed",))
    assert VectorRow("ujb_shaft_x", VectorPart.ORDER1_PHASE) in source.rows
    assert source.mapped_channels == ("speed",)
    assert source.averaging.n_polls == 60
    with pytest.raises(MisfitError, match='quantity = "order1_amplitude"') as refusal:
        source.require_fit((*IDS, "ljb_shaft_x"), ("speed",))
    assert refusal.value.at == ("source", "map_file")


def test_vectors_and_samples_are_not_taken_for_each_other():
    with pytest.raises(MisfitError, match='requires kind "modbus_vector"'):
        polled(map=None, map_file=SKF, poll_period_s=5.0).require_fit(IDS, ("speed",))
    amplitudes = [
        {"channel": id_, "address": n, "quantity": "order1_amplitude", "detector": "pk"}
        for n, id_ in enumerate(IDS)
    ]
    plain = {"value": [*amplitudes, *({"channel": i, "address": 90} for i in IDS[:1])]}
    with pytest.raises(MisfitError, match="requires a vector quantity"):
        vector(map=plain, map_file=None).require_fit(IDS, ())


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"map_file": None}, "exactly one of map and map_file must be given"),
        ({"map": WAVES}, "exactly one of map and map_file must be given"),
        ({"map_file": "maps/absent.toml"}, "register map cannot be used"),
        ({"poll_period_s": 0.5}, "must be at least 1 s, the minimum in the register map"),
        ({"poll_period_s": 40.0}, "must be at least two poll periods, 80 s"),
        ({"hop_polls": 61}, "must not be above n_polls, 60"),
        ({"min_polls": 61}, "must not be above n_polls, 60"),
    ],
)
def test_a_rack_that_can_never_work_is_refused(settings, said):
    with pytest.raises(ValidationError) as refusal:
        vector(**settings)
    assert said in str(refusal.value)


def test_a_device_is_not_given_less_time_than_its_map_asks():
    with pytest.raises(
        ValidationError, match="must be at least 1 s, the minimum in the register map"
    ):
        polled(map=WAVES | {"min_timeout_s": 1.0}, timeout_s=0.9)


def test_a_serial_line_cannot_be_connected_for_each_reply():
    with pytest.raises(ValidationError, match='must be "kept" on a serial line'):
        polled(host=None, device="/dev/ttyUSB0", connection="per_reply")


def test_a_map_with_many_mistakes_is_refused_in_one_line(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text("bass = 1\nbast = 2\n")
    with pytest.raises(ValidationError) as refusal:
        slow_device(map_file=str(path))
    said = str(refusal.value.errors()[0]["ctx"]["error"])
    assert said.count("map.toml:") == 3
    assert "\n" not in said


def test_a_slow_device_measures_slow_channels_alone():
    slow = slow_device()
    known = ("speed", "active_power", "ujb_oil_temperature", "ljb_oil_temperature")

    slow.require_fit(known)
    assert slow.mapped_channels == known
    with pytest.raises(MisfitError, match="unknown channel 'ljb_oil_temperature'") as refusal:
        slow.require_fit(known[:3])
    assert refusal.value.at == ("slow_source", "map_file")


def test_a_queue_of_twelve_channels_fits_into_a_reading():
    layout = fifo().fifo_layout(12)

    assert layout.record_registers == 13
    assert layout.removes


@pytest.mark.parametrize(
    ("settings", "n_channels", "said"),
    [
        ({}, 31, "at most 31"),
        ({"addresses": [0, 1]}, 2, "number of addresses must be 1, got 2"),
        ({"layout": "per_channel"}, 2, "number of addresses must be 2, got 1"),
    ],
)
def test_queues_that_do_not_fit_the_channels_are_refused(settings, n_channels, said):
    with pytest.raises(MisfitError, match=said) as refusal:
        fifo(**settings).fifo_layout(n_channels)
    assert refusal.value.at[0] == "source"


TWO = {"layout": "per_channel", "addresses": [0, 1]}


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"has_counter": False, "reading": "keeps"}, "which samples are new"),
        (TWO | {"has_counter": False}, "belong together"),
        (TWO | {"addresses": [5, 5]}, "must not contain an address twice"),
        ({"addresses": [70_000]}, "less than or equal to 65535"),
    ],
)
def test_a_queue_that_cannot_be_followed_is_refused(settings, said):
    with pytest.raises(ValidationError, match=said):
        fifo(**settings)


IDENTITY: TypeAdapter[IdentitySettings] = TypeAdapter(IdentitySettings)


def test_an_identity_reaches_the_adapter_as_it_was_written():
    signature = {"kind": "signature", "address": 1000, "words": [0x0102, 7], "function": 4}
    assert identity_of(IDENTITY.validate_python(signature)) == ExpectedRegisters(
        address=1000, words=(0x0102, 7), function=4
    )
    identification = {"kind": "identification", "vendor": "Acme", "revision": "1.4"}
    assert identity_of(IDENTITY.validate_python(identification)) == Identification(
        vendor="Acme", revision="1.4"
    )
    assert identity_of(None) is None


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"kind": "signature", "address": 0, "words": []}, "at least 1 item"),
        ({"kind": "signature", "address": 0, "words": [65_536]}, "less than or equal to 65535"),
        ({"kind": "signature", "address": 65_535, "words": [1, 2]}, "beyond register 65535"),
        ({"kind": "signature", "address": 0, "words": [1], "function": 6}, "should be 3 or 4"),
        ({"kind": "identification"}, "vendor, product_code or revision must"),
        ({"kind": "face"}, "'signature', 'identification'"),
    ],
)
def test_an_identity_that_cannot_be_is_refused(wrong, complaint):
    with pytest.raises(ValidationError, match=complaint):
        IDENTITY.validate_python(wrong)


CAN = {
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
CAN_PROFILE = {
    "kind": "can",
    "interface": "slcan",
    "channel": "socket://127.0.0.1:0",
    "profile": "padwatch_int16",
}


def test_a_can_source_is_read_by_its_dbc_or_by_a_profile(tmp_path):
    source = CanSettings.model_validate(CAN, context={FOLDER: tmp_path})
    assert source.dbc_path == tmp_path / "daq.dbc"
    assert source.signals["y"] == ("WAVE.y0", "WAVE.y1")
    source.check_channels(["x", "y"], ["oil"])
    CanSettings.model_validate(CAN_PROFILE).check_channels(["any"], [])


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"dbc": None}, "dbc", "exactly one of dbc and profile must be given, found neither"),
        ({"profile": "padwatch_int16"}, "dbc", "found both"),
        ({"signals": {}}, "signals", "must name a signal for each waveform channel"),
        ({"seconds": "T.s"}, "microseconds", "must be given together"),
        ({"microseconds": "T.us"}, "seconds", "must be given together"),
        ({"data_bitrate": 2_000_000}, "data_bitrate", "set fd = true"),
        ({"stamps": "interface"}, "stamps", 'must be "host": slcan sends no time stamps'),
        ({"interface": "socketcan"}, "bitrate", "must be set by the system: ip link set"),
        ({"counter_counts": "frames", "frame_samples": ["W.n"]}, "counter_counts", '"samples"'),
    ],
)
def test_what_does_not_fit_a_can_source_is_refused_with_its_key(change, key, words):
    with pytest.raises(ValidationError, match=words) as refusal:
        CanSettings.model_validate(CAN | change)
    assert refusal.value.errors()[0]["ctx"]["error"].at == (key,)


CAN_OWN = ({"signals": {"x": "A.b"}}, {"counters": ["A.b"]}, {"epoch": "A.b"})


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (CAN | {"signals": {"x": "no dot"}}, "pattern"),
        (CAN | {"signals": {"x": "A.b c"}}, "pattern"),
        (CAN | {"signals": {"x": []}}, "at least 1"),
        (CAN | {"interface": "Slcan!"}, "pattern"),
        (CAN | {"bitrate": 7}, "greater than or equal"),
        (CAN | {"receive_buffer": 1}, "greater than or equal"),
        (CAN | {"hold_samples": 0}, "greater than or equal"),
        (CAN | {"hold_s": 0.0}, "greater than or equal"),
        (CAN | {"when_full": "block"}, "drop"),
        (CAN | {"options": {"a b": 1}}, "pattern"),
        *((CAN_PROFILE | own, "applies only with dbc, not with profile") for own in CAN_OWN),
    ],
)
def test_a_wrong_value_of_a_can_source_is_refused(source, words):
    with pytest.raises(ValidationError, match=words):
        CanSettings.model_validate(source)


@pytest.mark.parametrize(
    ("channels", "slow", "words"),
    [
        (["x"], ["oil"], "unknown channel; known channels: x"),
        (["x", "y", "z"], ["oil"], "names no signal for z"),
        (["x", "y"], [], "unknown channel; known channels: none"),
        (["x", "y"], ["oil", "speed"], "names no signal for speed"),
    ],
)
def test_channels_and_signals_of_can_must_be_one_to_one(channels, slow, words):
    with pytest.raises(ValueError, match=words):
        CanSettings.model_validate(CAN).check_channels(channels, slow)
