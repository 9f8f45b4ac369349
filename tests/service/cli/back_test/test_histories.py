"""Rows of readings, from files or from the store, become histories or are refused by line."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pytest
from click.testing import Result
from rigs.command_line import padwatch
from rigs.tiers import first_fast

from core.baseline.history import ReadingOutcome
from core.change.backtest import DecisionHistory
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmNews, unjudged
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.machine.unit import Estimator
from core.quality import Reason
from core.units import DAY_NS
from service.cli.offline import backtest_files as stored
from service.cli.offline.backtest import event_of, time_ns_of
from service.cli.offline.backtest_bearing import Learning, MachineEvent, Period, periods_of
from service.cli.offline.backtest_cells import LINE, TEXTS
from service.cli.offline.backtest_files import read_histories
from service.cli.offline.backtest_histories import histories_of
from service.cli.offline.backtest_report import alarm_stretches, change_report
from service.store.sqlite import SqliteStore

STEP_NS = 600_000_000_000
PLACES = {("U1", "UJB"), ("U1", "LJB"), ("U2", "UJB")}


def columns(n: int = 6) -> dict[str, Any]:
    """Rows of three bearings, both directions, mixed as a plant would write them."""
    rows = [(time, *place, d) for time in range(n) for place in sorted(PLACES) for d in "xy"]
    size = len(rows)
    return {
        "time_ns": [STEP_NS * time for time, *_ in rows],
        "unit": [row[1] for row in rows],
        "bearing": [row[2] for row in rows],
        "direction": [row[3] for row in rows],
        "k_n_per_m": [1e9 + row for row in range(size)],
        "u_random": [0.01] * size,
        "eccentricity_ratio": [0.3 + 0.01 * time for time, *_ in rows],
        "oil_temperature_c": [40.0 + time for time, *_ in rows],
        "quality": ["good"] * size,
        "state": ["part_load"] * size,
    }


def as_read(rows: dict[str, Any]) -> dict[str, Any]:
    """Columns as they come from the reading process; line 1 is the heading."""
    found = {
        key: pa.array(column).dictionary_encode() if key in TEXTS else np.array(column)
        for key, column in rows.items()
    }
    return found | {LINE: np.arange(2, len(rows["unit"]) + 2)}


def test_every_row_finds_its_place_and_a_direction_without_a_row_has_no_number():
    found = histories_of(as_read(columns()), PLACES)
    assert set(found) == PLACES
    assert np.exp(found["U2", "UJB"].history.ln_k) == pytest.approx(
        1e9 + np.array([[6 * time + 4 + side for time in range(6)] for side in (0, 1)])
    )
    assert found["U1", "LJB"].history.oil_temperature_c.tolist() == [40 + t for t in range(6)]
    rows = {key: column[:-1] for key, column in columns().items()}
    history = histories_of(as_read(rows))["U2", "UJB"].history
    assert np.isnan(history.ln_k[1, -1])
    assert history.outcome[:, -1].tolist() == [ReadingOutcome.MEASURED, ReadingOutcome.BAD_QUALITY]


def test_a_reading_that_is_not_good_has_no_number_but_its_reason():
    rows = columns()
    rows["quality"][0:2] = ["bad", "insufficient_excitation"]
    rows["k_n_per_m"][1] = float("nan")
    history = histories_of(as_read(rows))["U1", "LJB"].history
    assert history.outcome[:, 0].tolist() == [
        ReadingOutcome.BAD_QUALITY,
        ReadingOutcome.INSUFFICIENT_EXCITATION,
    ]
    assert np.isnan(history.ln_k[:, 0]).all()


@pytest.mark.parametrize(
    ("key", "row", "value", "says"),
    [
        ("unit", 3, "U9", "line 5: unknown unit 'U9'"),
        ("bearing", 4, "XJB", "line 6: unit U2 has no bearing 'XJB'"),
        ("direction", 0, "z", "line 2: unknown direction 'z'"),
        ("quality", 7, "fine", "line 9: unknown quality 'fine'"),
        ("state", 1, "resting", "line 3: unknown state 'resting'"),
        ("k_n_per_m", 5, -1.0, "line 7: k_n_per_m must be above 0, got -1.0"),
        ("k_n_per_m", 5, float("nan"), "line 7: k_n_per_m must be above 0, got nan"),
        ("k_n_per_m", 5, float("inf"), "line 7: k_n_per_m must be finite, got inf"),
        ("u_random", 5, 0.0, "line 7: u_random must be above 0, got 0.0"),
        ("oil_temperature_c", 2, float("inf"), "line 4: oil_temperature_c must be finite"),
        ("time_ns", 6, 0, "line 8: two rows have the same time"),
        ("time_ns", 12, 1, "line 14: time is earlier than in the previous row"),
        ("eccentricity_ratio", 1, 0.4, "line 3: eccentricity_ratio differs"),
        ("state", 1, "full_load", "line 3: state differs"),
    ],
)
def test_a_wrong_row_is_refused_with_its_line(key, row, value, says):
    rows = columns()
    rows[key][row] = value
    with pytest.raises(ValueError, match=says):
        histories_of(as_read(rows), PLACES)


def test_many_wrong_rows_are_refused_briefly():
    rows = columns()
    rows["quality"] = ["fine"] * len(rows["unit"])
    with pytest.raises(ValueError, match=r"line 11: .*; and 26 more"):
        histories_of(as_read(rows))


DAYS = np.arange(100) * DAY_NS


def event(day: float, text: str = "overhaul") -> MachineEvent:
    return MachineEvent("U1", None, round(day * DAY_NS), text)


def test_each_event_begins_to_learn_anew_and_learning_ends_where_told():
    assert periods_of(DAYS, [], Learning(30)) == [Period(1, 0, 30, 100)]
    events = [event(70.5, "second"), event(50, "first")]
    assert periods_of(DAYS, events, Learning(20)) == [
        Period(1, 0, 20, 50),
        Period(2, 50, 70, 71, "first"),
        Period(3, 71, 91, 100, "second"),
    ]
    assert periods_of(DAYS + DAY_NS, [event(0), event(200)], Learning(30)) == [
        Period(1, 0, 30, 100, "overhaul")
    ]
    learning = Learning(20, until_ns=10 * DAY_NS)
    learned = [period.learned for period in periods_of(DAYS, [event(50)], learning)]
    assert learned == [10, 70]
    assert periods_of(DAYS, [event(10)], Learning(20))[0] == Period(1, 0, 10, 10)


def test_times_need_an_offset_and_an_event_is_a_place_a_time_and_words():
    assert time_ns_of("2025-01-01T02:00:00.000001+02:00") == 1_735_689_600_000_001_000
    with pytest.raises(ValueError, match="requires an offset from UTC"):
        time_ns_of("2025-01-01T02:00:00")
    with pytest.raises(ValueError, match="is not a time such as"):
        time_ns_of("yesterday")
    time_ns = 1_735_689_600 * 10**9
    of_unit = event_of("U1 2025-01-01T00:00:00Z new pads, LJB")
    assert of_unit == MachineEvent("U1", None, time_ns, "new pads, LJB")
    of_bearing = event_of("U1/LJB 2025-01-01T00:00:00Z")
    assert of_bearing == MachineEvent("U1", "LJB", time_ns, "machine event")
    assert of_bearing.is_about("U1", "LJB")
    assert not of_bearing.is_about("U1", "UJB")


@pytest.mark.parametrize("text", ["", "U1", "U1/ 2025-01-01T00:00:00Z", "U/1/2 x", "Ü 2025-01-01Z"])
def test_what_is_no_event_is_refused_with_an_example(text):
    with pytest.raises(
        ValueError, match="is not an event such as 'U1 2026-03-01T08:00:00Z overhaul'"
    ):
        event_of(text)


def decided(level: list[int], change: list[float]) -> DecisionHistory:
    n = len(level)
    return DecisionHistory(
        verdict=np.array(level, np.int8),
        level=np.array(level, np.int8),
        change=np.array(change),
        significance=np.full(n, 10.0),
        time_scale_h=np.full(n, 4.0),
    )


def test_an_alarm_that_rises_is_one_and_those_that_return_are_counted_each():
    decisions = decided([0, 1, 2, 1, 0], [0.0, -0.05, -0.2, -0.1, 0.0])
    (found,) = alarm_stretches(decisions)
    assert (found.begin, found.danger, found.end, found.level) == (1, 2, 4, AlarmLevel.DANGER)
    assert found.largest == 2
    largest = change_report(decisions, found.largest)
    assert largest.percent == pytest.approx(100.0 * (np.exp(-0.2) - 1.0))
    assert largest.u_percent == pytest.approx(100.0 * np.exp(-0.2) * 0.02)
    found = list(alarm_stretches(decided([1, 0, 1, 1], [0.1, 0.0, 0.2, 0.3])))
    assert [(alarm.begin, alarm.end, alarm.danger) for alarm in found] == [
        (0, 1, None),
        (2, None, None),
    ]
    assert list(alarm_stretches(decided([0, 0, 0], [0.0, 0.1, 0.2]))) == []
    assert list(alarm_stretches(decided([], []))) == []


T0 = 1_767_225_600_000_000_000
STORED_STEP_NS = 600 * 10**9
N = 50
NAN = float("nan")
EVIDENCE = [ReadingOutcome(n % 10 if n % 10 < 3 else 0) for n in range(N)]
FINDINGS = unjudged(Verdict.NO_BASELINE)


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
        time_ns=T0 + n * STORED_STEP_NS,
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
        FilmNews(film_reading(n, bearing), FINDINGS, (INITIAL_DECISION,) * len(FINDINGS))
        for bearing in ("UJB", "LJB")
        for n in range(N)
    )
    store.close()
    return plant_path


def export(*arguments: object) -> Result:
    return padwatch("readings", "export", *arguments)


@pytest.mark.long
@pytest.mark.parametrize("suffix", first_fast(1, [".csv", ".parquet"]))
def test_stored_readings_come_back_out_of_the_file(filled, tmp_path, suffix, monkeypatch):
    monkeypatch.setattr(stored, "AT_ONCE_NS", 7 * STORED_STEP_NS)
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


def test_only_the_time_that_is_asked_for_is_written(filled, tmp_path):
    out = tmp_path / "readings.csv"
    between = ["--start", "2026-01-01T01:00:00Z", "--end", "2026-01-01T04:00:00+01:00"]
    assert export(filled, out, *between).exit_code == 0
    assert pacsv.read_csv(out).num_rows == 2 * 2 * 12


def test_what_cannot_be_written_is_said_and_leaves_nothing_behind(filled, tmp_path):
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
