"""A mapping file says everything, or is refused with line, key and fix."""

from pathlib import Path

import pytest

from service.settings.import_mapping import ImportMapping
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


def refusal(tmp_path: Path, text: str) -> str:
    path = tmp_path / "map.toml"
    path.write_text(text)
    with pytest.raises(TomlFileError) as error:
        load_toml(path, ImportMapping)
    assert str(error.value).startswith(f"{path}:")
    return str(error.value).removeprefix(str(path))


@pytest.mark.parametrize("text", [CSV, MDF])
def test_a_right_mapping_is_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "map.toml").write_text(text)
    mapping = load_toml(tmp_path / "map.toml", ImportMapping)
    assert mapping.channel[0].column == "UJB X"
    assert mapping.time.zone == "-03:00"


def test_a_start_needs_no_time_zone_beside_its_own(tmp_path: Path) -> None:
    old, start = MDF[MDF.index("source") : MDF.index("[[")], "2026-01-01T10:00:00-03:00"
    text = MDF.replace(old, f'source = "start"\nstart = {start}\n')
    (tmp_path / "map.toml").write_text(text)
    assert load_toml(tmp_path / "map.toml", ImportMapping).time.start.isoformat() == start


FORMAT, UNIT = 'format = "csv"', 'unit = "um"'


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('zone = "-03:00"\n', "", ":3: time.zone: is needed: "),
        ('"-03:00"', '"CET"', ":7: time.zone = 'CET': String should match pattern"),
        ('"-03:00"', '"-15:00"', "time.zone = '-15:00': String should match"),
        (FORMAT, 'format = "wav"', ":1: format = 'wav': Input should be 'mdf4'"),
        (FORMAT, 'format = "tdms"', ":6: time.form = 'iso8601': is only for csv, this is tdms"),
        ('"column"\n', '"file"\n', ":4: time.source = 'file': csv has no time of its own; write"),
        ('form = "iso8601"\n', "", 'time.form: is needed for source "column"'),
        ("iso8601", "elapsed_s", "time.start: is needed: what time counts from"),
        ("iso8601", "timestamp", "time.form = 'timestamp': is only for tdms, this is csv"),
        ("zone = ", "start = 2026-01-01\nzone = ", "time.start"),
        ("zone = ", "start = 2026-01-01T00:00:00\nzone = ", "time.start"),
        ("zone = ", "start = 2026-01-01T00:00:00Z\nzone = ", "00:00+00:00': has no effect here"),
        (UNIT, "", ":9: channel[1].unit: Field required"),
        (UNIT, "unit = 3", ":12: channel[1].unit = 3: Input should be a valid string"),
        (UNIT, f'{UNIT}\ngroup = "a"', ":13: channel[1].group: csv has no groups"),
        (UNIT, f"{UNIT}\ngain = 2", ":13: channel[1].gain = 2: Extra inputs"),
        ("[[channel]]", "[[chanel]]", "chanel"),
        (CSV[CSV.index("[[channel]]") :], "", "channel: needs at least one for csv"),
        ("[[channel]]", CSV[CSV.index("[[channel]]") :] + "[[channel]]", "is used twice"),
        ("[time]", "[time", "not TOML"),
    ],
)
def test_a_wrong_mapping_is_refused_with_line_and_key(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    assert old in CSV
    assert says in refusal(tmp_path, CSV.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[[channel]]", "[csv]\n[[channel]]", "csv: is for CSV files, this one is mdf4"),
        ("[time]", 'bus = "can0"\n[time]', ":3: bus = 'can0': is for CAN logs, this one is mdf4"),
        ("mdf4", "tdms", ":5: time.zone = '-03:00': tdms is in UTC; write"),
        ("mdf4", "candump", "candump is in UTC"),
        ("-03:00", "UTC", "channel: are those of the DBC file for"),
        ('source = "file"', 'source = "start"', "time.start: is needed"),
    ],
)
def test_a_wrong_mapping_of_another_format_is_refused_too(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    text = MDF.replace("mdf4", "candump") if new == "UTC" else MDF
    assert says in refusal(tmp_path, text.replace(old, new, 1))


def test_the_example_in_the_guide_is_a_right_mapping(tmp_path: Path) -> None:
    guide = (Path(__file__).parents[3] / "docs" / "how-to" / "recordings.md").read_text()
    blocks = [block.split("```")[0] for block in guide.split("```toml\n")[1:]]
    mapping = next(block for block in blocks if "slow_channel" in block)
    (tmp_path / "map.toml").write_text(mapping)
    assert load_toml(tmp_path / "map.toml", ImportMapping).slow_channel[0].unit == "degC"


def test_a_mapping_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.toml"
    for content, words in (
        (b"\xff\xfe", "not UTF-8 text at byte 0"),
        (b"#" * 1_000_001, "larger than 1000000 bytes"),
        (b"a = " + b"[" * 100_000, "not TOML"),
    ):
        path.write_bytes(content)
        with pytest.raises(TomlFileError, match=words):
            load_toml(path, ImportMapping)
    with pytest.raises(TomlFileError, match="No such file"):
        load_toml(tmp_path / "absent", ImportMapping)
