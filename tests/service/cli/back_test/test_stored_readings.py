"""What the service has stored of its films comes back as a file, and out of the file."""

from pathlib import Path

import numpy as np
import pyarrow.csv as pacsv
import pytest
from click.testing import Result
from rigs.command_line import padwatch

from core.baseline.history import ReadingOutcome
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmFinding, FilmNews
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.quality import Reason
from service.cli.offline import backtest_files as stored
from service.cli.offline.backtest_files import read_histories
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000
STEP_NS = 600 * 10**9
N = 50
NAN = float("nan")
EVIDENCE = [ReadingOutcome(n % 10 if n % 10 < 3 else 0) for n in range(N)]
FINDING = FilmFinding(Verdict.NO_BASELINE)


def value(n: int, shift: float) -> FilmValue:
    is_measured = EVIDENCE[n] is ReadingOutcome.MEASURED
    return FilmValue(
        ln_k=20.0 + shift + 0.01 * n if is_measured else NAN,
        u_random=0.01 if is_measured else NAN,
        shaft_um_pk=50.0 + n,
        bearing_um_pk=NAN,
        outcome=EVIDENCE[n],
        reason=Reason.OK,
    )


def film_reading(n: int, bearing: str) -> FilmReading:
    state = OperatingState.PART_LOAD if n < 30 else OperatingState.FULL_LOAD
    return FilmReading(
        unit="U1",
        bearing=bearing,
        estimator=Estimator.DYNAMIC,
        time_ns=T0 + n * STEP_NS,
        condition=BearingCondition(state, True, None),
        speed_rpm=92.3,
        power_mw=500.0,
        eccentricity_ratio=0.2 + 0.001 * n,
        u_eccentricity=0.01,
        attitude_deg=NAN if n == 5 else 30.0,
        oil_temperature_c=45.0,
        values=(value(n, 0.0), value(n, 0.5)),
    )


@pytest.fixture
def filled(plant_path: Path) -> Path:
    """A plant file whose database has readings of two bearings."""
    store = SqliteStore(plant_path.parent / "data" / "padwatch.sqlite3")
    store.films.add_simulated(
        FilmNews(film_reading(n, bearing), (FINDING, FINDING), (INITIAL_DECISION, INITIAL_DECISION))
        for bearing in ("UJB", "LJB")
        for n in range(N)
    )
    store.close()
    return plant_path


def export(*arguments: object) -> Result:
    return padwatch("readings", "export", *arguments)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_stored_readings_come_back_out_of_the_file(
    filled: Path, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "AT_ONCE_NS", 7 * STEP_NS)
    out = tmp_path / f"readings{suffix}"
    result = export(filled, out)
    assert result.exit_code == 0, result.output
    assert f"U1 UJB: {N} readings, dynamic, {N} of them simulated" in result.output
    found = read_histories(out)
    assert set(found) == {("U1", "UJB"), ("U1", "LJB")}
    rows = found["U1", "LJB"]
    expected = [film_reading(n, "LJB") for n in range(N)]
    assert rows.history.time_ns.tolist() == [r.time_ns for r in expected]
    for side in range(2):
        ln_k = np.array([r.values[side].ln_k for r in expected])
        np.testing.assert_allclose(rows.history.ln_k[side], ln_k, rtol=1e-14)
    for key in ("attitude_deg", "eccentricity_ratio", "power_mw", "u_eccentricity"):
        column = np.array([getattr(r, key) for r in expected])
        assert np.array_equal(getattr(rows.history, key), column, equal_nan=True)
    assert rows.history.outcome[0].tolist() == EVIDENCE
    assert rows.history.shaft_um_pk[1].tolist() == [50.0 + n for n in range(N)]
    assert rows.state is not None
    assert rows.state.tolist() == [r.condition.state for r in expected]


def test_only_the_time_that_is_asked_for_is_written(filled: Path, tmp_path: Path) -> None:
    out = tmp_path / "readings.csv"
    between = ["--start", "2026-01-01T01:00:00Z", "--end", "2026-01-01T04:00:00+01:00"]
    assert export(filled, out, *between).exit_code == 0
    assert pacsv.read_csv(out).num_rows == 2 * 2 * 12


def test_what_cannot_be_written_is_said_and_leaves_nothing_behind(
    filled: Path, tmp_path: Path
) -> None:
    out = tmp_path / "readings.csv"
    nothing = export(filled, out, "--start", "2027-01-01T00:00:00Z", "--end", "2028-01-01T00:00Z")
    assert (nothing.exit_code, out.exists()) == (1, False)
    assert "no film readings in this time range" in nothing.output
    assert export(filled, tmp_path / "readings.txt").exit_code == 2
    naive = export(filled, out, "--start", "2027-01-01T00:00:00")
    assert naive.exit_code == 2
    assert "requires an offset from UTC" in naive.output
    out.write_text("mine", encoding="utf-8")
    assert export(filled, out).exit_code == 1
    assert out.read_text(encoding="utf-8") == "mine"
