"""A wrong plant file is refused with line, key, value and what is allowed."""

import os
from pathlib import Path

import pytest

from service.settings.plant import load_plant_file
from service.settings.toml_file import MAX_FILE_BYTES, TomlFileError

UNIT_1 = "unit[1]."
CHANNEL_1 = "unit[1].channel[1]."
UJB = "unit[1].bearing[1]."


KIND, HOST = 'kind = "modbus_ring"', 'host = "127.0.0.1"\nport = 0'
SLOW, OIL = f"{UNIT_1}slow_channel", 'oil_temperature = "ujb_oil_temperature"'
OIL_LIMIT = "alarms.oil_temperature_c = { alert = 65.0 }"
SIMULATION = f"{UNIT_1}simulation."
PROBE, HEAD = 'transducer = "proximity_probe"', 'quantity = "head"'
SLOW_2, PAD = "unit[2].slow_channel", 'quantity = "pad_temperature"\n'
PAD_1, PAD_2, HEAD_2, GATE = (f"{SLOW_2}[{n}]." for n in (6, 7, 10, 11))
BRACKET, SOFT = "bracket_stiffness_n_per_m", "bracket_stiffnes = 'soft'"


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ("= 1.18e9", "= 1.18", f"{UJB}bracket_stiffness_n_per_m = 1.18", "between 1e7 and 1e12"),
        ("= 200.0\ngap", "= nan\ngap", f"{UJB}clearance_um = nan", "finite number"),
        ("= 200.0\ngap", "= 0.2\ngap", f"{UJB}clearance_um = 0.2", "20 to 5000"),
        ("[2000.0, 2000.0]", "[2.0e3]", f"{UJB}gap_reference_um[2]", "missing"),
        ("= 4.0\n", "= 4000.0\n", f"{CHANNEL_1}sensitivity = 4000.0", "0.5 to 50 V/mm"),
        ('"V/mm"', '"mV/g"', f"{CHANNEL_1}sensitivity_unit = 'mV/g'", '"V/mm" or "mV/um"'),
        ('"V/mm"', '"V/m"', f"{CHANNEL_1}sensitivity_unit = 'V/m'", "'mV/(m/s2)'"),
        ("min_v = 1.0", "min_v = 11.0", f"{CHANNEL_1}ok_min_v = 11.0", "below ok_max_v = 11"),
        ("ok_min_v = 1.0", "ok_min = 1.0", f"{CHANNEL_1}ok_min = 1.0", "with unit_per_count"),
        ("= 600.0", "= true", f"{UNIT_1}rate_hz = true", "valid number"),
        ("= 600.0", "= 2026-11-21", f"{UNIT_1}rate_hz = datetime.date(", "valid number"),
        ("port = 0", "port = 70000", f"{UNIT_1}source.port = 70000", "65535"),
        ("port = 0", "port = 502.5", f"{UNIT_1}source.port = 502.5", "integer"),
        (HOST, f'{HOST[:18]}\ndevice = "x"', f"{UNIT_1}source.host = '127", "found both"),
        (HOST, 'device_id = 250\ndevice = "x"', f"{UNIT_1}source.device_id = 250", "be 1 to 247"),
        (KIND, 'kind = "opc"', f"{UNIT_1}source.kind = 'opc'", "must be 'modbus_ring' or 'modbus_"),
        ('id = "U1"', 'id = "U/1"', f"{UNIT_1}id = 'U/1'", "match"),
        ('id = "U1"', 'id = "plant"', f"{UNIT_1}id = 'plant'", "alarms of the whole plant"),
        ('id = "U2"', 'id = "U1"', "unit[2].id = 'U1'", "used twice"),
        ('id = "LJB"', 'id = "UJB"', f"{UNIT_1}bearing[2].id = 'UJB'", "used twice"),
        ('"ujb_shaft_y"', '"ujb_shaft_x"', f"{UNIT_1}channel[2].id = 'ujb_shaft_x'", "used twice"),
        ('id = "active_power"', 'id = "speed"', f"{SLOW}[2].id = 'speed'", "used twice"),
        ('id = "speed"', 'id = "ujb_shaft_x"', f"{SLOW}[1].id = 'ujb_shaft_x'", "waveform channel"),
        ('_x = "ujb_shaft_x"', '_x = "z"', f"{UJB}shaft_x = 'z'", "known channels: ujb_shaft"),
        ('_x = "ujb_bearing_x"', '_x = "ujb_shaft_x"', f"{UJB}bearing_x = 'ujb_", "used twice"),
        ('l = "speed"', 'l = "rpm"', f"{UNIT_1}speed_channel = 'rpm'", "channels: speed, active_"),
        (OIL, 'oil_temperature = "speed"', f"{UJB}oil_temperature = 'speed'", "in degC"),
        ("minimum = 0.0", "minimum = 200.0", f"{SLOW}[1].minimum = 200.0", "maximum"),
        ('"127.0.0.1"', '"0.0.0.0"', "service.host = '0.0.0.0'", "[service.tls]"),
        ("seed = 1\n", "seed = -1\n", f"{SIMULATION}seed = -1", "greater than or equal to 0"),
        ('g = "LJB"', 'g = "UJB"', f"{SIMULATION}bearing[2].bearing = 'UJB'", "used twice"),
        ('id = "UJB"', 'id = "GEN"', f"{UJB}id = 'GEN'", "UJB or LJB or TJB"),
        (f"{BRACKET} =", f"{SOFT}\n{BRACKET} =", f"{UJB}{SOFT}: unknown key", f"{BRACKET}, "),
        (f"{BRACKET} = 1.18e9\n", "", f"{UJB}bracket_mass_kg = 45000.0", f"only with {BRACKET}"),
        (PAD, 'quantity = "pads"\n', f"{PAD_1}quantity = 'pads'", "'pad_temperature', 'oil_"),
        (PAD, "", f"{PAD_1}bearing = 'UJB'", "requires quantity"),
        ('"%"', '"m"', f"{GATE}unit = 'm'", 'must be "%" for quantity gate_opening'),
        ('"UJB"\nposition', '"X"\nposition', f"{PAD_1}bearing = 'X'", "of the unit"),
        ('position = "2"', 'position = "1"', f"{PAD_2}position = '1'", "its own position"),
        ('position = "1"', 'position = "mean"', f"{PAD_1}position = 'mean'", "computed value"),
        ("angle_deg = 135.0", "angle_deg = 45.0", f"{PAD_2}angle_deg = 45.0", "another pad"),
        ("alert = 85.0", "alert = 95.0", f"{PAD_1}limits.danger = 95.0", "above alert = 95"),
        (HEAD, f"angle_deg = 1.0\n{HEAD}", f"{HEAD_2}angle_deg = 1.0", "only to quantity pad"),
        (PROBE, f"angle_deg = 75.0\n{PROBE}", f"{CHANNEL_1}angle_deg = 75.0", "at least 30°"),
        ("[[unit.bearing]]", "[[unit.bearings]]", f"{UNIT_1}bearings: unknown key", "bearing, "),
        ("= 600.0", "= rated", "invalid TOML: Invalid value (column", "; text needs quotes"),
        ('"Unit 1, part load"', '"Unit 1', "invalid TOML", ""),
        ('name = "', 'name = "\\u001b[2J', "plant.name: must not contain control characters", ""),
        ('"var/demo"', '"var\\u0000demo"', "service.data_folder: must not contain con", ""),
        ('"Unit 1,', '"Unit\\u00851,', f"{UNIT_1}name: must not contain control characters", ""),
        (OIL, OIL_LIMIT, f"{UJB}alarms.oil_t", "requires oil_temperature, the slow"),
        ("off_hz = 20.0", "off_hz = 300.0", f"{SIMULATION}hydraulic_cutoff_hz = 300.0", "300 Hz"),
    ],
)
def test_a_wrong_value_is_named_with_line_key_and_limits(changed, mistakes, old, new, key, said):
    text, line = changed(old, new)

    found = mistakes(text)[0]

    assert found.startswith(f"{line}: {key}")
    assert said in found


ADDRESS = "host=db.plant.example dbname=padwatch user=padwatch"
BOTH = f'postgresql = "{ADDRESS} passfile=x"\npassword_file = "y"'


@pytest.mark.parametrize(
    ("table", "settings", "key", "said"),
    [
        ("analysis", "vortex_order = 0.45", "vortex_order = 0.45", "[0.2, 0.4]"),
        ("analysis", "vortex_band = [0.3, 0.4]", "vortex_order (by default)", "[0.3, 0.4]"),
        ("analysis", "vortex_band = [0.4, 0.2]", "vortex_band = [0.4, 0.2]", "0.05 <= low < high"),
        ("analysis", "segment_samples = 1024", "segment_samples = 1024", "at least 3121 samples"),
        ("analysis", "max_frequency_hz = 3.0", "max_frequency_hz = 3.0", "3.07667 Hz"),
        ("analysis", "max_frequency_hz = 300", "max_frequency_hz = 300", "half the sampling rate"),
        ("analysis", "n_segments = 3", "min_segments (by default)", "n_segments = 3"),
        ("analysis", "overlap = 1.0", "overlap = 1.0", "0.9"),
        ("capture", "max_s = 100.0", "max_s = 100.0", "at least pre_s + post_s = 180 s"),
        ("capture", "pre_s = 601.0", "pre_s = 601.0", "600"),
        ("capture", "max_gb = 0.0", "max_gb = 0.0", "greater than 0"),
        ("capture", "samples = 'some'", "samples = 'some'", "'kept' or 'not_kept'"),
        ("alarms", "link_lost_after_s = 0.5", "link_lost_after_s = 0.5", "equal to 1"),
        ("alarms", "max_clock_offset_s = 0.0", "max_clock_offset_s = 0.0", "than 0"),
        ("alarms", "clock = 'off'", "clock = 'off'", "'judged' or 'ignored'"),
        ("alarms", "chattering_activations = 1", "chattering_activations = 1", "equal to 2"),
        ("alarms", "chattering_window_s = 0.0", "chattering_window_s = 0.0", "equal to 1"),
        ("alarms", "max_waiting_share = 1.0", "max_waiting_share = 1.0", "less than 1"),
        ("alarms", "max_samples_lost_share = 0.0", "max_samples_lost_share = 0.0", "than 0"),
        ("alarms", "store_failing_after_s = -1.0", "store_failing_after_s = -1.0", "equal to 0"),
        ("store", 'password_file = "x"', "password_file = 'x'", "applies only with postgresql"),
        ("store", f'postgresql = "{ADDRESS} password=x"', "postgresql", "not contain a password"),
        ("store", 'postgresql = "postgresql://a:x@b.c/d"', "postgresql", "not contain a password"),
        ("store", 'postgresql = "no address"', "postgresql", "is not a libpq connection string"),
        ("store", 'postgresql = "hostname=x"', "postgresql", "is not a libpq connection string"),
        ("store", BOTH, "password_file = 'y'", "not be given with passfile"),
    ],
)
def test_a_table_that_does_not_fit_is_refused_at_its_line_and_no_password_is_shown(
    plant_text, mistakes, table, settings, key, said
):
    header = plant_text.count("\n") + 1
    given = [table, *(line.split(" ")[0] for line in settings.split("\n"))]
    name = key.split(" ")[0]
    where = header + (given.index(name) if name in given else 0)

    [found] = mistakes(f"{plant_text}[{table}]\n{settings}\n")

    assert found.startswith(f"{where}: {table}.{key}")
    assert said in found
    assert "password=x" not in found
    assert ":x@" not in found


@pytest.mark.parametrize(
    ("line_of_file", "key"),
    [
        ("clearance_um = 200.0\n", f"{UJB}clearance_um"),
        ('bearing = "UJB"\nposition = "1"\n', f"{PAD_1}bearing"),
        ("rated_speed_rpm = 92.3\n", f"{UNIT_1}rated_speed_rpm"),
        ("full_scale_v = 12.0\n", f"{CHANNEL_1}full_scale_v"),
        ("ok_max_v = 11.0\n", f"{CHANNEL_1}ok_max_v"),
        ('kind = "modbus_ring"\n', f"{UNIT_1}source.kind"),
    ],
)
def test_a_missing_key_is_named_at_the_table_that_lacks_it(
    plant_text, changed, mistakes, line_of_file, key
):
    text, line = changed(line_of_file, "")
    header = max(n for n, at in enumerate(plant_text.split("\n"), 1) if at[:1] == "[" and n <= line)

    [found] = mistakes(text)

    assert found.startswith(f"{header}: {key} is missing")


def test_several_mistakes_are_all_named_at_once(plant_text, mistakes):
    text = plant_text.replace("= 1.18e9", "= 1.18").replace('"V/mm"', '"V/m"', 3)
    text = text.replace('name = "Demo plant"', 'nmae = "Demo plant"')

    found = mistakes(text)

    assert len(found) == 2 + 3 + 2
    assert sum("bracket_stiffness_n_per_m = 1.18:" in line for line in found) == 2
    assert sum("sensitivity_unit = 'V/m'" in line for line in found) == 3
    assert any("plant.name is missing" in line for line in found)
    assert any(
        "plant.nmae = 'Demo plant': unknown key (did you mean name?)" in line for line in found
    )


def test_lines_are_counted_as_editors_do_also_where_a_file_is_not_utf_8(plant_text, mistakes):
    text = f"# a comment with \u2028 and \x85\r\n{plant_text.replace('= 1.18e9', '= 1.18', 1)}"

    [found] = mistakes(text)

    line = plant_text[: plant_text.index("= 1.18e9")].count("\n") + 2
    assert found.startswith(f"{line}: {UJB}bracket_stiffness_n_per_m")

    latin_1 = plant_text.replace('"Demo plant"', '"Tucuruí"').encode("latin-1")

    [found] = mistakes(latin_1)

    assert found.startswith(f"{plant_text[: plant_text.index('Demo plant')].count(chr(10)) + 1}: ")
    assert "is not valid UTF-8" in found


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("9" * 5000, "an integer has too many digits"),
        ("9" * 400, "finite number"),
        ("[" * 5000 + "]" * 5000, "nested too deeply"),
        ("[" * 240 + "]" * 240, "nested too deeply"),
    ],
    ids=["5000 digits", "400 digits", "5000 brackets", "240 brackets"],
)
def test_a_monstrous_value_is_refused_in_a_short_line(changed, mistakes, value, said):
    text, _ = changed("= 600.0", f"= {value}")

    [found] = mistakes(text)

    assert said in found
    assert len(found) < 300


def test_a_path_that_is_no_plant_file_is_refused_in_one_line(tmp_path):
    pipe, huge = tmp_path / "pipe", tmp_path / "huge"
    os.mkfifo(pipe)
    huge.touch()
    os.truncate(huge, 10**10)
    for path, said in (
        (tmp_path / "absent.toml", "No such file"),
        (tmp_path, "Is a directory"),
        (Path("/dev/zero"), "not a regular file"),
        (pipe, "not a regular file"),
        (huge, f"larger than {MAX_FILE_BYTES} bytes"),
    ):
        with pytest.raises(TomlFileError, match=said) as refusal:
            load_plant_file(path)
        assert str(refusal.value).startswith(f"{path}: ")
        assert "\n" not in str(refusal.value)


def test_a_file_that_is_nested_too_deeply_is_refused(mistakes):
    for text in ("a." * 4_000 + "a = 1", "a = " + "[" * 4_000 + "]" * 4_000):
        assert mistakes(text) == [" tables or arrays are nested too deeply"]


def test_an_empty_file_or_a_key_with_a_line_break_is_refused_in_its_lines(mistakes, changed):
    assert [line.split(" — ")[0] for line in mistakes("")] == [
        "1: plant is missing",
        "1: unit is missing",
    ]
    [found] = mistakes(changed("[plant]\n", '[plant]\n"na\\nme" = "x"\n')[0])
    assert "'na\\nme' = 'x': unknown key" in found


BESIDE = """
[unit.slow_source]
device = "/dev/ttyUSB0"
poll_period_s = 1.0
[[unit.slow_source.map.value]]
channel = "speed"
address = 1

[[unit]]
"""


def test_a_line_that_two_units_or_devices_are_read_on_is_refused(plant_text, mistakes, changed):
    text = plant_text.replace(HOST, 'device = "/dev/ttyUSB0"')
    line = text.rpartition("device =")[0].count("\n") + 1

    [said] = mistakes(text)

    assert said.startswith(f"{line}: unit[2].source.device = '/dev/ttyUSB0'")
    assert "is already used by source of unit[1]; a serial line has one master" in said

    text, _ = changed(HOST, 'device = "/dev/ttyUSB0"')
    first, unit_1, unit_2 = text.split("\n[[unit]]\n")

    [said] = mistakes(f"{first}\n[[unit]]\n{unit_1}{BESIDE}{unit_2}")

    assert "unit[1].slow_source.device = '/dev/ttyUSB0': is already used by source" in said


@pytest.mark.parametrize("devices", [("/dev/ttyUSB0", "/dev/ttyUSB1"), ("pty", "pty")])
def test_own_lines_and_those_that_the_simulated_daq_makes_are_fine(plant_text, tmp_path, devices):
    for device in devices:
        plant_text = plant_text.replace(HOST, f'device = "{device}"', 1)
    path = tmp_path / "plant.toml"
    path.write_text(plant_text)

    assert [unit.source.device for unit in load_plant_file(path).unit[:2]] == list(devices)
