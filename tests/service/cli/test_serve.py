"""`padwatch serve` says what it needs."""

from pathlib import Path

from typer.testing import CliRunner

from service.cli.commands import app
from service.cli.serve import NEEDS_POSTGRESQL

PLANT = Path(__file__).parents[3] / "deploy" / "plant.toml"


def test_a_plant_without_postgresql_is_not_served_apart() -> None:
    done = CliRunner().invoke(app, ["serve", str(PLANT), "--port", "0"])

    assert done.exit_code == 2
    assert NEEDS_POSTGRESQL in done.output
