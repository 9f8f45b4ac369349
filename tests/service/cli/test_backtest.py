"""`padwatch backtest` as a user sees it."""

import json
from pathlib import Path

import pytest
from rigs.command_line import padwatch

HEADINGS = (
    "time,unit,bearing,direction,k_n_per_m,u_random,eccentricity_ratio,oil_temperature_c,quality"
)


def rows(n: int, bearing: str = "UJB", cells: str = "1e9,0.01,0.3,40.5") -> list[str]:
    return [
        f"2025-01-{1 + i // 144:02d}T{i // 6 % 24:02d}:{i % 6}0:00Z,U1,{bearing},{d},{cells},good"
        for i in range(n)
        for d in "xy"
    ]


@pytest.fixture
def readings(tmp_path: Path) -> Path:
    """Four days at part load, which is too little to learn from."""
    path = tmp_path / "readings.csv"
    lines = [HEADINGS + ",state", *(line + ",part_load" for line in rows(576))]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def test_a_report_is_one_json_document(readings: Path) -> None:
    result = padwatch("backtest", readings, "--learn-days", 2, "--json")
    assert result.exit_code == 0, result.stderr
    report = json.loads(result.stdout)
    assert report["rows"] == 2 * 576
    assert [(f["unit"], f["bearing"], f["direction"]) for f in report["films"]] == [
        ("U1", "UJB", "x"),
        ("U1", "UJB", "y"),
    ]
    film = report["films"][0]
    assert film["learning"] == 288
    assert film["verdicts"]["no_baseline"] == 288
    assert film["baselines"][0]["is_learned"] is False
    assert report["rate"] == {
        "unit_years": pytest.approx(2 / 365.25, rel=0.01),
        "n_alarms": 0,
        "n_danger": 0,
        "alarms_per_unit_year": 0.0,
    }
    assert report["doubts"] == ["U1 UJB: no attitude_deg, so its baseline does not use it"]
    assert report["readings_per_s"] > 0.0


def test_people_get_tables(readings: Path) -> None:
    result = padwatch("backtest", readings)
    assert result.exit_code == 0
    for words in ("Readings by verdict", "U1 UJB x", "too few readings to learn", "Alarms: 0"):
        assert words in result.stdout


def test_every_row_counts_whatever_is_to_be_learned_first(readings: Path) -> None:
    until = padwatch("backtest", readings, "--learn-until", "2025-01-02T00:00:00Z", "--json")
    assert json.loads(until.stdout)["films"][1]["learning"] == 144
    event = ["--event", "U1/UJB 2025-01-03T00:00:00Z new pads", "--learn-days", 1]
    film = json.loads(padwatch("backtest", readings, *event, "--json").stdout)["films"][0]
    assert [b["event"] for b in film["baselines"]] == ["", "new pads"]
    assert film["learning"] == 2 * 144


def test_units_are_those_of_the_plant_file(readings: Path, plant_path: Path) -> None:
    assert padwatch("backtest", readings, "--plant", plant_path).exit_code == 0
    text = readings.read_text(encoding="utf-8").replace(",U1,UJB,y", ",U7,UJB,y", 1)
    readings.write_text(text, encoding="utf-8")
    result = padwatch("backtest", readings, "--plant", plant_path)
    assert result.exit_code == 1
    assert result.stderr == f"padwatch backtest: {readings}: line 3: unknown unit 'U7'\n"


def test_settings_are_tried_and_wrong_ones_refused_with_their_line(
    readings: Path, tmp_path: Path
) -> None:
    settings = tmp_path / "settings.toml"
    settings.write_text("reading_period_s = 3600.0\nlearning_days = 1.0\n", encoding="utf-8")
    report = json.loads(padwatch("backtest", readings, "--settings", settings, "--json").stdout)
    assert report["films"][0]["learning"] == 144
    assert any("are 10 min apart" in doubt for doubt in report["doubts"])
    settings.write_text("[change]\nalert_change = 0.2\ndanger_change = 0.1\n", encoding="utf-8")
    result = padwatch("backtest", readings, "--settings", settings)
    assert result.exit_code == 2
    assert f"{settings}:3: change.danger_change = 0.1: must be above alert_change" in result.stderr
    settings.write_text("[change]\nalert = 0.2\n", encoding="utf-8")
    assert padwatch("backtest", readings, "--settings", settings).exit_code == 2


@pytest.mark.parametrize(
    ("options", "code", "says"),
    [
        (["--learn-until", "2025-01-02"], 2, "requires an offset from UTC"),
        (["--learn-days", "0"], 2, "greater than or equal to 1"),
        (["--event", "overhaul"], 2, "is not an event such as"),
        (["--event", "U9 2025-01-02T00:00:00Z"], 1, "event of U9: the file has no readings of U9"),
        (["--export", "."], 2, ".: the file or folder exists already"),
    ],
)
def test_wrong_options_are_refused(
    readings: Path, options: list[str], code: int, says: str
) -> None:
    result = padwatch("backtest", readings, *options)
    assert (result.exit_code, result.stdout) == (code, "")
    assert says in result.stderr


def test_states_are_not_needed_where_speed_and_power_tell(readings: Path, plant_path: Path) -> None:
    lines = [HEADINGS + ",speed_rpm,power_mw", *(line + ",92.3,500" for line in rows(20))]
    readings.write_text("\n".join(lines), encoding="utf-8")
    rated = "rated_power_mw = 700.0\nrated_speed_rpm"
    plant_path.write_text(plant_path.read_text().replace("rated_speed_rpm", rated, 1))
    assert padwatch("backtest", readings, "--plant", plant_path).exit_code == 0
