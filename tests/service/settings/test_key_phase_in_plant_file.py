"""Key-phase, probes and slow-roll vectors in the plant file."""

import cmath
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from core.machine.channel import Measurand, SlowRollVector
from service.settings.core_values import calibration_of, machine_of
from service.settings.loading import load_plant_file

Mistakes = Callable[[str | bytes], list[str]]

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


def test_key_phase_and_vector_reach_the_numerics(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(text, encoding="utf-8")
    unit = load_plant_file(path).unit[0]
    machine, calibration = machine_of(unit), calibration_of(unit)

    assert machine.key_phase == "kp"
    assert machine.channels[-1].measurand is Measurand.KEY_PHASE_V
    assert calibration.channels[-1].unit_per_v == 1.0
    assert machine.channels[0].probe == "SN123"
    assert machine.channels[0].slow_roll == SlowRollVector(
        "ujb_shaft_x",
        "SN123",
        cmath.rect(8.0, math.radians(30.0)),
        8.0,
        1_772_359_200_000_000_000,
    )
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
        (SHAFT_X + 'probe = "SN123"\n', SHAFT_X, f"{CHANNEL_1}probe (by default)", "slow_roll"),
        ("sensitivity = 4.0\n", "", f"{CHANNEL_1}sensitivity (by default)", "0.5 to 50 V/mm"),
        ('sensitivity_unit = "V/mm"\n', "", f"{CHANNEL_1}sensitivity_unit (by", '"V/mm" or "mV/'),
    ],
)
def test_a_wrong_key_phase_or_vector_is_refused_with_key_and_value(
    text: str, mistakes: Mistakes, old: str, new: str, key: str, said: str
) -> None:
    assert old in text
    [found] = mistakes(text.replace(old, new, 1))

    assert found.split(": ", 1)[1].startswith(key)
    assert said in found
