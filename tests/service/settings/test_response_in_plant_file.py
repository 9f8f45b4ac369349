"""A transducer's response from the plant file reaches the numerics."""

from pathlib import Path

import numpy as np
import pytest

from service.conversion import machine_of
from service.settings.loading import PlantFileError, load_plant_file

EXAMPLE = Path(__file__).parents[3] / "deploy" / "plant.toml"
CHANNEL = 'id = "ujb_bearing_x"\n'


def written(folder: Path, response: str) -> Path:
    path = folder / "plant.toml"
    path.write_text(EXAMPLE.read_text().replace(CHANNEL, f"{CHANNEL}response = {response}\n"))
    return path


def test_a_high_pass_is_known_to_the_channel(tmp_path: Path) -> None:
    path = written(tmp_path, '[{ kind = "high_pass", corner_hz = 0.5 }]')
    channel = machine_of(load_plant_file(path).unit[0]).channels[2]
    assert channel.response is not None
    # 0.61 of a 0.385 Hz line passes a 0.5 Hz corner (Brito et al., section 3.3)
    assert abs(channel.response.at(np.array([0.385]))[0]) == pytest.approx(0.61, abs=0.005)


def test_a_sheet_is_looked_for_beside_the_plant_file(tmp_path: Path) -> None:
    sheet = "frequency_hz,magnitude,phase_deg\n0.1,0.2,78.0\n1.0,0.9,20.0\n10.0,1.0,0.0\n"
    (tmp_path / "sheet.csv").write_text(sheet)
    path = written(tmp_path, '[{ kind = "sheet", file = "sheet.csv" }]')
    channel = machine_of(load_plant_file(path).unit[0]).channels[2]
    assert channel.response is not None
    assert abs(channel.response.at(np.array([1.0]))[0]) == pytest.approx(0.9)


def test_a_sheet_that_is_not_there_is_named_with_the_line_of_its_channel(tmp_path: Path) -> None:
    path = written(tmp_path, '[{ kind = "sheet", file = "missing.csv" }]')
    with pytest.raises(PlantFileError, match=r"plant\.toml:\d+: .*missing\.csv"):
        load_plant_file(path)
