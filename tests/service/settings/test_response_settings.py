from pathlib import Path

import pytest
from pydantic import TypeAdapter, ValidationError

from core.transducer_response import HighPass, Resonance, ResponseChain, ResponseTable
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
