"""A serial line has one master: who reads it twice is told when the file is loaded."""

import pytest

from service.settings.loading import load_plant_file

HOST = 'host = "127.0.0.1"\nport = 0'
BESIDE = """
[unit.slow_source]
device = "/dev/ttyUSB0"
poll_period_s = 1.0
[[unit.slow_source.map.value]]
channel = "speed"
address = 1

[[unit]]
"""


def test_a_line_that_two_units_or_two_devices_of_a_unit_are_read_on_is_refused(
    plant_text: str, mistakes, changed
) -> None:
    text = plant_text.replace(HOST, 'device = "/dev/ttyUSB0"')
    line = text.rpartition("device =")[0].count("\n") + 1

    [said] = mistakes(text)

    assert said.startswith(f"{line}: unit[2].source.device = '/dev/ttyUSB0'")
    assert "is read by source of unit[1] already: a serial line has one source" in said

    text, _ = changed(HOST, 'device = "/dev/ttyUSB0"')
    first, unit_1, unit_2 = text.split("\n[[unit]]\n")

    [said] = mistakes(f"{first}\n[[unit]]\n{unit_1}{BESIDE}{unit_2}")

    assert "unit[1].slow_source.device = '/dev/ttyUSB0': is read by source of unit[1]" in said


@pytest.mark.parametrize("devices", [("/dev/ttyUSB0", "/dev/ttyUSB1"), ("pty", "pty")])
def test_lines_of_their_own_and_those_that_the_simulated_daq_makes_are_fine(
    plant_text: str, tmp_path, devices
) -> None:
    for device in devices:
        plant_text = plant_text.replace(HOST, f'device = "{device}"', 1)
    path = tmp_path / "plant.toml"
    path.write_text(plant_text)

    assert [unit.source.device for unit in load_plant_file(path).unit[:2]] == list(devices)
