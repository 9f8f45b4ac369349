"""Responses, key-phase, probes and slow-roll vectors in the plant file."""

import cmath
import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from core.machine.channel import Measurand, SlowRollVector
from core.machine.response import HighPass, Resonance, ResponseChain, ResponseTable
from service.settings.core_values import calibration_of, machine_of
from service.settings.plant import load_plant_file
from service.settings.toml_file import TomlFileError
from service.settings.transducers import (
    FOLDER,
    ResponseSettings,
    SheetError,
    read_calibration_sheet,
    response_of,
)

PARTS: TypeAdapter[tuple[ResponseSettings, ...]] = TypeAdapter(tuple[ResponseSettings, ...])


def test_a_transducer_is_flat_or_the_parts_of_its_response_work_one_after_the_other(tmp_path):
    (tmp_path / "amplifier.csv").write_text("frequency_hz,magnitude,phase_deg\n1,1,0\n2,1,0\n")
    text = """[{"kind": "high_pass", "corner_hz": 0.5, "order": 2},
               {"kind": "resonance", "natural_hz": 2500.0, "damping": 0.02},
               {"kind": "sheet", "file": "amplifier.csv"}]"""

    parts = PARTS.validate_json(text, strict=True, context={FOLDER: tmp_path})

    assert response_of(parts) == ResponseChain(
        (
            HighPass(0.5, 2),
            Resonance(2500.0, 0.02),
            ResponseTable((1.0, 2.0), (1.0, 1.0), (0.0, 0.0)),
        )
    )

    assert response_of(()) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[{"kind": "high_pass", "corner_hz": 0.0}]', "greater than or equal to 0.001"),
        ('[{"kind": "high_pass", "corner_hz": 0.5, "order": 3}]', "Input should be 1 or 2"),
        ('[{"kind": "resonance", "natural_hz": 100.0, "damping": 0.0}]', "or equal to 0.001"),
        ('[{"kind": "low_pass", "corner_hz": 0.5}]', "'high_pass', 'resonance', 'sheet'"),
        ('[{"kind": "sheet", "file": "nowhere.csv"}]', "nowhere.csv: No such file"),
    ],
)
def test_a_response_that_means_nothing_is_refused(tmp_path, text, message):
    with pytest.raises(ValidationError) as refused:
        PARTS.validate_json(text, strict=True, context={FOLDER: tmp_path})
    assert message in str(refused.value)


EXAMPLE = Path(__file__).parents[3] / "deploy" / "plant.toml"
CHANNEL = 'id = "ujb_bearing_x"\n'


def written(folder: Path, response: str) -> Path:
    path = folder / "plant.toml"
    path.write_text(EXAMPLE.read_text().replace(CHANNEL, f"{CHANNEL}response = {response}\n"))
    return path


@pytest.mark.parametrize(
    ("response", "at_hz", "passed"),
    [
        # 0.61 of a 0.385 Hz line passes a 0.5 Hz corner (Brito et al., section 3.3)
        ('[{ kind = "high_pass", corner_hz = 0.5 }]', 0.385, 0.61),
        ('[{ kind = "sheet", file = "sheet.csv" }]', 1.0, 0.9),
    ],
)
def test_a_response_is_known_to_its_channel_and_a_sheet_lies_beside_the_plant_file(
    tmp_path, response, at_hz, passed
):
    sheet = "frequency_hz,magnitude,phase_deg\n0.1,0.2,78.0\n1.0,0.9,20.0\n10.0,1.0,0.0\n"
    (tmp_path / "sheet.csv").write_text(sheet)
    channel = machine_of(load_plant_file(written(tmp_path, response)).unit[0]).channels[2]
    assert channel.response is not None
    assert abs(channel.response.at(np.array([at_hz]))[0]) == pytest.approx(passed, abs=0.005)


def test_a_sheet_that_is_not_there_is_named_with_the_line_of_its_channel(tmp_path):
    path = written(tmp_path, '[{ kind = "sheet", file = "missing.csv" }]')
    with pytest.raises(TomlFileError, match=r"plant\.toml:\d+: .*missing\.csv"):
        load_plant_file(path)


HEADER = "frequency_hz,magnitude,phase_deg\n"
GOOD_LINES = HEADER + "0.1,0.2,78\n1,0.89,26.5\n10,1.0,3\n"


def sheet(folder: Path, text: str) -> Path:
    path = folder / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        GOOD_LINES,
        "\ufeff" + GOOD_LINES.replace("\n", "\r\n"),
        "# calibrated 2026-03-02\n" + GOOD_LINES + "\n\n",
        "phase_deg, magnitude, frequency_hz\n78, 0.2, 0.1\n26.5, 0.89, 1\n3, 1.0, 10\n",
    ],
    ids=["plain", "from a spreadsheet", "with remarks", "other order"],
)
def test_a_calibration_sheet_is_read_as_it_was_written(tmp_path, text):
    assert read_calibration_sheet(sheet(tmp_path, text)) == ResponseTable(
        (0.1, 1.0, 10.0), (0.2, 0.89, 1.0), (78.0, 26.5, 3.0)
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r":1: columns must be frequency_hz, magnitude, phase_deg, got "),
        ("frequency_hz,gain\n1,1\n", r":1: columns must be .*, got frequency_hz, gain"),
        (GOOD_LINES.replace(",", ";"), r":1: columns must be .*frequency_hz;magnitude"),
        (HEADER + "0,1,0\n1,1,0\n", r":2: frequency_hz must be above 0, got 0"),
        (HEADER + "1,1,0\n3,1,0\n2,1,0\n", r":4: frequency_hz must be above .*3, got 2"),
        (HEADER + "1,1,0\n1,1,0\n", r":3: frequency_hz must be above .*1, got 1"),
        (HEADER + "1,1,0\n2,,0\n3,1,0\n", r":3: magnitude is missing"),
        (HEADER + "1,1,0\n\n3,1,0\n", r":3: expected 3 values, got 0"),
        (HEADER + "1,1,0\n2,1\n", r":3: expected 3 values, got 2"),
        (HEADER + "1,1,0\n2,0,0\n", r":3: magnitude must be above 0, got 0"),
        (HEADER + "1,nan,0\n2,1,0\n", r":2: magnitude must be finite, got nan"),
        (HEADER + "1,1,0\ninf,1,0\n", r":3: frequency_hz must be finite, got inf"),
        (HEADER + "1,1,zero\n2,1,0\n", r":2: phase_deg must be a number, got 'zero'"),
        (HEADER + "1,1,0\n", r":2: expected at least two points, got 1"),
    ],
)
def test_a_wrong_sheet_is_refused_with_file_and_line(tmp_path, text, message):
    path = sheet(tmp_path, text)
    with pytest.raises(SheetError, match=r"sheet\.csv" + message):
        read_calibration_sheet(path)


def test_what_is_no_text_or_not_there_is_refused(tmp_path):
    with pytest.raises(SheetError, match=r"nowhere\.csv: No such file"):
        read_calibration_sheet(tmp_path / "nowhere.csv")
    with pytest.raises(SheetError, match="Is a directory"):
        read_calibration_sheet(tmp_path)
    path = tmp_path / "sheet.csv"
    path.write_bytes(HEADER.encode() + b"1,1,0\n\xff\xfe\n")
    with pytest.raises(SheetError, match=r"sheet\.csv:3: byte 39 is not valid UTF-8"):
        read_calibration_sheet(path)
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(SheetError, match="larger than 1000000 bytes"):
        read_calibration_sheet(path)


def test_a_sheet_of_ten_points_a_decade_reads_a_corner_between_them_true(tmp_path):
    corner, points_hz = HighPass(0.5), np.geomspace(0.05, 50.0, 31)
    lines = [
        f"{f:.6g},{abs(h):.6g},{np.degrees(np.angle(h)):.6g}\n"
        for f, h in zip(points_hz, corner.at(points_hz), strict=True)
    ]
    between_hz = np.geomspace(0.05, 50.0, 400)

    table = read_calibration_sheet(sheet(tmp_path, HEADER + "".join(lines)))

    assert np.abs(table.at(between_hz) / corner.at(between_hz) - 1.0).max() < 5e-4


KEY_PHASE = """[[unit.channel]]
id = "kp"
transducer = "key_phase"
full_scale_v = 12.0
ok_min_v = -1.0
ok_max_v = 11.0

"""
VECTOR = (
    "slow_roll = { um_pk = 8.0, phase_deg = 30.0, speed_rpm = 8.0,"
    ' taken = 2026-03-01T10:00:00Z, probe = "SN123" }'
)
SHAFT_X = 'id = "ujb_shaft_x"\n'
CHANNEL_1 = "unit[1].channel[1]."


@pytest.fixture
def text(plant_text: str) -> str:
    """The demonstration plant with a key-phase and a vector at its first probe."""
    found = plant_text.replace("[[unit.slow_channel]]", f"{KEY_PHASE}[[unit.slow_channel]]", 1)
    found = found.replace(SHAFT_X, f'{SHAFT_X}probe = "SN123"\n{VECTOR}\n', 1)
    return found.replace('speed_channel = "speed"', 'key_phase = "kp"\nspeed_channel = "speed"', 1)


def test_key_phase_and_vector_reach_the_numerics(text, tmp_path):
    path = tmp_path / "plant.toml"
    path.write_text(text, encoding="utf-8")
    unit = load_plant_file(path).unit[0]
    machine, calibration = machine_of(unit), calibration_of(unit)

    assert machine.key_phase == "kp"
    assert machine.channels[-1].measurand is Measurand.KEY_PHASE_V
    assert calibration.channels[-1].unit_per_v == 1.0
    assert machine.channels[0].probe == "SN123"
    phasor_um_pk = cmath.rect(8.0, math.radians(30.0))
    assert machine.channels[0].slow_roll == SlowRollVector("SN123", phasor_um_pk, 8.0)
    assert machine.channels[1].slow_roll is None
    assert machine.channels[0].unit_per_count == calibration.channels[0].unit_per_count != 0.0


KEY = 'transducer = "key_phase"'
CHANNEL_13, BEARING_X = "unit[1].channel[13].", 'id = "ujb_bearing_x"\n'
ROLL = f"{CHANNEL_1}slow_roll."


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ('e = "kp"', 'e = "kq"', "unit[1].key_phase = 'kq'", "known: kp"),
        ('e = "kp"', 'e = "ujb_bearing_x"', "unit[1].key_phase = 'ujb_", 'transducer "key_phase"'),
        ('_x = "ujb_shaft_x"', '_x = "kp"', "unit[1].bearing[1].shaft_x = 'kp'", "be a vibration"),
        (KEY, f"{KEY}\nsensitivity = 1.0", f"{CHANNEL_13}sensitivity = 1.0", "remove it"),
        (KEY, f'{KEY}\nsensitivity_unit = "V/mm"', f"{CHANNEL_13}sensitivity_unit", "remove it"),
        (KEY, f"{KEY}\n{VECTOR}", f"{CHANNEL_13}slow_roll", "remove it"),
        (BEARING_X, f'{BEARING_X}probe = "S"\n', "unit[1].channel[3].probe = 'S'", "not velocity"),
        ("um_pk = 8.0", "um_pk = -8.0", f"{ROLL}um_pk = -8.0", "equal to 0"),
        ("= 30.0", "= 400.0", f"{ROLL}phase_deg = 400.0", "360"),
        ("= 8.0, taken", "= 0.0, taken", f"{ROLL}speed_rpm = 0.0", "than 0"),
        ("10:00:00Z", "10:00:00", f"{ROLL}taken = 2026-03-01T10:00:00", "timezone"),
        ("taken = 2026-03-01T10:00:00Z, ", "", f"{ROLL}taken is missing", "offset"),
        (', probe = "SN123" }', " }", f"{ROLL}probe is missing", "another probe"),
        (', probe = "SN123" }', ', probe = "" }', f"{ROLL}probe = ''", "1 char"),
        (SHAFT_X + 'probe = "SN123"\n', SHAFT_X, f"{CHANNEL_1}probe is missing", "slow_roll"),
        ("sensitivity = 4.0\n", "", f"{CHANNEL_1}sensitivity (by default)", "0.5 to 50 V/mm"),
        ('sensitivity_unit = "V/mm"\n', "", f"{CHANNEL_1}sensitivity_unit (by", '"V/mm" or "mV/'),
    ],
)
def test_a_wrong_key_phase_or_vector_is_refused_with_key_and_value(
    text, mistakes, old, new, key, said
):
    assert old in text
    [found] = mistakes(text.replace(old, new, 1))

    assert found.split(": ", 1)[1].startswith(key)
    assert said in found
