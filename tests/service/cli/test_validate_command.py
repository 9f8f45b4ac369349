import json

import pytest
import typer
from typer.testing import CliRunner

from service.cli import validate as command
from service.cli.offline import validation as paper


def runner_result(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command.validate)
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.stdout


def test_validate_prints_every_table_or_as_json_a_row_for_every_figure() -> None:
    exit_code, text = runner_result()

    assert exit_code == 0
    for place in ("Table 4", "Table 5", "Table 6", "Table 7", "Table 8", "Table 9", "Section 3.2"):
        assert place in text
    assert "80 amplitudes" in text
    assert "20 of 20 stiffnesses" in text

    exit_code, text = runner_result("--json")
    rows = json.loads(text)

    assert exit_code == 0
    assert len(rows) == 100
    keys = ("table", "condition", "bearing", "quantity", "paper", "padwatch", "error_percent")
    assert set(rows[0]) == set(keys)
    *_, printed, found, error_percent = (rows[0][key] for key in keys)
    assert error_percent == pytest.approx(100 * (found / printed - 1))


def test_validate_fails_when_a_printed_figure_is_not_explained(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrong = paper.MeasuredRow(8, "G6.65 t0", "UJB", "55", "20", "0.46")
    monkeypatch.setattr(paper, "MEASURED", (wrong, *paper.MEASURED[1:]))

    exit_code, text = runner_result()

    assert exit_code == 1
    assert "19 of 20" in text
