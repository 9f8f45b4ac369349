"""A transducer's response in the plant file, and on its way to the numerics."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from core.transducer_response import HighPass, Resonance, ResponseChain, ResponseTable
from service.conversion import machine_of
from service.settings.loading import PlantFileError, load_plant_file
from service.settings.response import FOLDER, ResponseSettings, response_of

PARTS: TypeAdapter[tuple[ResponseSettings, ...]] = TypeAdapter(tuple[ResponseSettings, ...])


def test_a_transducer_without_response_is_flat() -> None:
    assert response_of(()) is None


def test_the_parts_of_a_response_work_one_after_the_other(tmp_path: Path) -> None:
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
def test_a_response_that_means_nothing_is_refused(tmp_path: Path, text: str, message: str) -> None:
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
    tmp_path: Path, response: str, at_hz: float, passed: float
) -> None:
    sheet = "frequency_hz,magnitude,phase_deg\n0.1,0.2,78.0\n1.0,0.9,20.0\n10.0,1.0,0.0\n"
    (tmp_path / "sheet.csv").write_text(sheet)
    channel = machine_of(load_plant_file(written(tmp_path, response)).unit[0]).channels[2]
    assert channel.response is not None
    assert abs(channel.response.at(np.array([at_hz]))[0]) == pytest.approx(passed, abs=0.005)


def test_a_sheet_that_is_not_there_is_named_with_the_line_of_its_channel(tmp_path: Path) -> None:
    path = written(tmp_path, '[{ kind = "sheet", file = "missing.csv" }]')
    with pytest.raises(PlantFileError, match=r"plant\.toml:\d+: .*missing\.csv"):
        load_plant_file(path)
