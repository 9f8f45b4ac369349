"""Mappings of imports and register maps are read, or refused with line, key and fix."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.modbus.decoding import MapDecoder
from core.spectra.polls import VectorPart, VectorRow
from service.settings.sources.mapping import ImportMapping
from service.settings.sources.register_map import load_map_file
from service.settings.toml_file import TomlFileError, load_toml

CSV = """\
format = "csv"

[time]
source = "column"
column = "time"
form = "iso8601"
zone = "-03:00"

[[channel]]
id = "ujb_shaft_x"
column = "UJB X"
unit = "um"
"""

MDF = CSV.replace("csv", "mdf4").replace(
    'source = "column"\ncolumn = "time"\nform = "iso8601"', 'source = "file"'
)
CANDUMP = MDF.replace("mdf4", "candump")


def mapping_of(path: Path) -> ImportMapping:
    return load_toml(path, ImportMapping)


VALUE = re.compile(r" = (\[.*\]|{.*}|.*?)(?=: )| \(by default\)")


def refusal(tmp_path: Path, text: str, load: Callable[[Path], object] = mapping_of) -> str:
    """Return the mistakes without the name of the file, then also without the wrong values."""
    path = tmp_path / "map.toml"
    path.write_text(text)
    with pytest.raises(TomlFileError) as error:
        load(path)
    assert str(error.value).startswith(f"{path}:")
    found = str(error.value).replace(str(path), "")
    return f"{found}\n{VALUE.sub('', found)}"


@pytest.mark.parametrize("text", [CSV, MDF])
def test_a_right_mapping_is_read(tmp_path, text):
    (tmp_path / "map.toml").write_text(text)
    mapping = mapping_of(tmp_path / "map.toml")
    assert mapping.channel[0].column == "UJB X"
    assert mapping.time.zone == "-03:00"


def test_a_start_needs_no_time_zone_beside_its_own(tmp_path):
    old, start = MDF[MDF.index("source") : MDF.index("[[")], "2026-01-01T10:00:00-03:00"
    text = MDF.replace(old, f'source = "start"\nstart = {start}\n')
    (tmp_path / "map.toml").write_text(text)
    assert mapping_of(tmp_path / "map.toml").time.start.isoformat() == start


FORMAT, UNIT = 'format = "csv"', 'unit = "um"'
WRONG_CSV = [
    ('zone = "-03:00"\n', "", ":3: time.zone is missing; give "),
    ('"-03:00"', '"CET"', ":7: time.zone = 'CET': String should match pattern"),
    ('"-03:00"', '"-15:00"', "time.zone = '-15:00': String should match"),
    (FORMAT, 'format = "wav"', ":1: format = 'wav': Input should be 'mdf4'"),
    (FORMAT, 'format = "tdms"', ":6: time.form = 'iso8601': applies only to csv, not to tdms"),
    ('"column"\n', '"file"\n', ':4: time.source = \'file\': must be "column" or "start" for csv'),
    ('form = "iso8601"\n', "", 'time.form is missing; source "column" req'),
    ("iso8601", "elapsed_s", "time.start is missing; it is the origin of the times"),
    ("iso8601", "timestamp", "time.form = 'timestamp': applies only to tdms, not to csv"),
    ("zone = ", "start = 2026-01-01\nzone = ", "time.start"),
    ("zone = ", "start = 2026-01-01T00:00:00\nzone = ", "time.start"),
    ("zone = ", "start = 2026-01-01T00:00:00Z\nzone = ", "00:00+00:00: does not apply to abs"),
    (UNIT, "", ":9: channel[1].unit is missing"),
    (UNIT, "unit = 3", ":12: channel[1].unit = 3: Input should be a valid string"),
    (UNIT, f'{UNIT}\ngroup = "a"', ":13: channel[1].group: csv has no groups"),
    (UNIT, f"{UNIT}\ngain = 2", ":13: channel[1].gain = 2: unknown key"),
    (CSV[CSV.index("[[channel]]") :], "", "channel is missing; format csv"),
    ("[[channel]]", CSV[CSV.index("[[channel]]") :] + "[[channel]]", "is used twice"),
]
WRONG_MDF = [
    ("[[channel]]", "[csv]\n[[channel]]", "csv: applies only to CSV files, not to mdf4"),
    ("[time]", 'bus = "can0"\n[time]', ":3: bus = 'can0': applies only to CAN logs, not to mdf4"),
    ("mdf4", "tdms", ":5: time.zone = '-03:00': must be \"UTC\" for tdms"),
    ("mdf4", "candump", 'must be "UTC" for candump'),
    ('source = "file"', 'source = "start"', "time.start is missing"),
]


@pytest.mark.parametrize(
    ("text", "old", "new", "says"),
    [
        *((CSV, *wrong) for wrong in WRONG_CSV),
        *((MDF, *wrong) for wrong in WRONG_MDF),
        (CANDUMP, "-03:00", "UTC", "channel: comes from the DBC file for"),
    ],
)
def test_a_wrong_mapping_is_refused_with_line_and_key(tmp_path, text, old, new, says):
    assert old in text
    assert says in refusal(tmp_path, text.replace(old, new, 1))


def test_the_example_in_the_guide_is_a_right_mapping(tmp_path):
    guide = (Path(__file__).parents[3] / "docs" / "how-to" / "recordings.md").read_text()
    blocks = [block.split("```")[0] for block in guide.split("```toml\n")[1:]]
    mapping = next(block for block in blocks if "slow_channel" in block)
    (tmp_path / "map.toml").write_text(mapping)
    assert mapping_of(tmp_path / "map.toml").slow_channel[0].unit == "degC"


MAPS = Path(__file__).parents[3] / "deploy" / "maps"


@pytest.mark.parametrize("path", sorted(MAPS.glob("*.toml")), ids=lambda path: path.name)
def test_every_example_can_be_read(path):
    decoder = MapDecoder(load_map_file(path).register_map())

    assert decoder.plan.spans
    assert all(request.count <= 125 for request in decoder.plan.spans)


def test_an_skf_like_rack_is_read_as_its_manual_demands():
    registers = load_map_file(MAPS / "vector-rack-skf-like.toml").register_map()
    requests = [(r.address, r.count) for r in MapDecoder(registers).plan.spans]

    assert (608, 14) in requests
    amplitude = registers.values[0]
    assert amplitude.id == VectorRow("ujb_shaft_x", VectorPart.ORDER1_AMPLITUDE).id
    assert amplitude.scale == 0.5, "peak-to-peak becomes zero-to-peak"
    assert registers.values[1].scale == -0.1, "lag becomes lead"


FLAGGED = """
[[value]]
channel = "a"
address = 10
flag = [{ address = 11, type = "bit", bit = 7, set_means = "ok" }]
"""


def test_a_status_of_a_single_bit_needs_no_mask(tmp_path):
    (tmp_path / "map.toml").write_text(FLAGGED)
    [value] = load_map_file(tmp_path / "map.toml").register_map().values
    assert [flag.mask for flag in value.flags] == [1]


MINIMAL = """
base = 1
[[value]]
channel = "a"
address = 10
type = "float32"
[[value]]
channel = "b"
address = 20
"""
END = "address = 20\n"
FLAG = "[[value.flag]]\naddress = 30\n"
FIELDS = '["day", "day", "year", "hour", "minute", "second"]'
CALENDAR = f'[time]\nkind = "calendar"\nfirst = {{ address = 50 }}\nfields = {FIELDS}\n'
BEHIND = [
    ("scale = 0.0", "value[2].scale = 0.0: must not be 0"),
    ('detector = "pp"', "value[2].detector"),
    ('quantity = "order1_amplitude"', "value[2].detector is missing; quantity"),
    ('quantity = "order1_phase"', "value[2].phase is missing; quantity"),
    ("bit = 3", "value[2].bit = 3: applies only to type"),
    ("invalid_values = [0.5]", "value[2].invalid_values: must be integers of 16 b"),
    ("scale_register = { address = 25 }", "scale_register: must be read in the same request"),
    ("full_scale = { minimum = 0.0 }", "value[2].full_scale.maximum: exactly one of maximum and"),
    ("[[together]]\naddress = 11\ncount = 5", "together: the block from register 11 contains only"),
    ("[[together]]\naddress = 40\ncount = 126", "together[1].count = 126"),
    ('[time]\nkind = "epoch"\nseconds = { address = 0 }', "time.seconds.address = 0: must be 1"),
    (CALENDAR.replace("50", "65532").replace('"day", "day"', '"month", "day"'), "1 to 65531"),
    (CALENDAR, "time.fields: must contain each of year, month"),
    (FLAG + "mask = 0\nset_means = 'bad'", ":12: value[2].flag[1].mask = 0: Input"),
    (FLAG, "value[2].flag[1].set_means: exactly one of"),
    (FLAG + "type = 'float32'\nset_means = 'bad'", ":12: value[2].flag[1].type = 'float32': mu"),
    (FLAG + "type = 'bit'\nfunction = 2\nmask = 2", "flag[1].mask = 2: does not apply to"),
    (FLAG + "set_means = 'bad'\nclipped_values = [1]", "requires ok_values"),
    (FLAG + "ok_values = [0, 16]\nmask = 0x00F0", "ok_values: must be within the mask, 0 to 15"),
    (FLAG + "ok_values = [0]\nclipped_values = [-1]", "0 to 65535, got -1"),
    ("function = 1", 'value[2].type: must be "bit" for functions 1 and 2'),
    ("type = 'bit'", "value[2].bit is missing; type"),
    ("scale_register = { address = 21, divisor = 0.0 }", "scale_register.divisor"),
    ("full_scale = { minimum = 1.0, maximum = 1.0 }", "full_scale.minimum: must differ"),
    (
        "full_scale = { minimum = 0.0, maximum = 1.0, raw_minimum = 9.0, raw_maximum = 9.0 }",
        "must be below raw_maximum = 9",
    ),
    ("invalid_below = 5.0\ninvalid_above = 5.0", "must be below invalid_above = 5"),
    ("invalid_values = [98304.0]", "integers of 16 bits, got 98304"),
    ("type = 'int32'\ninvalid_values = [-2147483649.0]", "integers of 32 bits"),
    (
        "type = 'bit'\nbit = 3\n[[value]]\nchannel = 'c'\naddress = 20\ntype = 'bit'\nbit = 3",
        "value[3].address: overlaps the registers of value 'b'",
    ),
]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("address = 20", "address = 11", ":9: value[2].address: overlaps"),
        ('"float32"', '"float16"', ":6: value[1].type = 'float16'"),
        ("address = 10", "address = 0", "value[1].address: must be 1 to 65535"),
        ("address = 10", "address = 65536", "value[1].address: must be 1 to 65535"),
        ('"b"', '"a"', "value: contains the id 'a' twice"),
        ("base = 1", "base = 2", ":2: base = 2: Input should be 0, 1, 10001"),
        (
            "base = 1",
            "base = 1\nmax_registers = 10\n[[together]]\naddress = 40\ncount = 11",
            "together[1].count: must not be above max_registers = 10",
        ),
        *((END, f"{END}{text}\n", said) for text, said in BEHIND),
    ],
)
def test_a_wrong_value_of_a_map_is_refused_with_line_key_and_fix(tmp_path, old, new, said):
    assert old in MINIMAL
    assert said in refusal(tmp_path, MINIMAL.replace(old, new, 1), load_map_file)
    assert "value is missing" in refusal(tmp_path, "", load_map_file)
