"""Parquet files of readings: what is taken, and what is refused with the row."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rigs.tiers import first_fast

from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_files import read_histories
from service.cli.offline.backtest_histories import Place
from service.cli.offline.backtest_tables import parquet_batches

N_ROWS = 20
UJB: Place = ("U1", "UJB")


def columns(n_rows: int = N_ROWS) -> dict[str, Any]:
    start = datetime(2025, 1, 1, tzinfo=UTC)
    return {
        "time": pa.array([start + timedelta(minutes=10 * n) for n in range(n_rows)]),
        "unit": ["U1"] * n_rows,
        "bearing": ["UJB"] * n_rows,
        "direction": ["x"] * n_rows,
        "k_n_per_m": np.full(n_rows, 1e9),
        "u_random": np.full(n_rows, 0.01),
        "eccentricity_ratio": np.full(n_rows, 0.3),
        "oil_temperature_c": np.full(n_rows, 40.0),
        "state": ["part_load"] * n_rows,
        "quality": ["good"] * n_rows,
    }


Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Writes a file, sound but for the columns given."""

    def write(**changes: Any) -> Path:
        path = tmp_path / "readings.parquet"
        pq.write_table(pa.table(columns() | changes), path)
        return path

    return write


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Rows of a file that harms nobody, read in this process."""
    with path.open("rb") as stream:
        return [row for batch, _ in parquet_batches(stream) for row in batch.to_pylist()]


def refusal(path: Path) -> str:
    with pytest.raises(ReadingsError) as refused:
        rows_of(path)
    return str(refused.value)


def with_value(key: str, value: Any, row: int = 7) -> Any:
    column = list(columns()[key])
    column[row] = value
    return column


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_time_stamps_of_any_unit_and_zone_are_the_same_moments(written, unit):
    there = columns()["time"].cast(pa.timestamp(unit, tz="America/Sao_Paulo"))
    time_ns = [row["time_ns"] for row in rows_of(written(time=there))]
    assert time_ns[:2] == [1_735_689_600 * 10**9, 1_735_690_200 * 10**9]


def test_names_may_be_in_a_dictionary_and_numbers_of_any_kind(written):
    path = written(
        unit=pa.array(["U1"] * N_ROWS).dictionary_encode(),
        oil_temperature_c=pa.array(range(N_ROWS), pa.int16()),
        eccentricity_ratio=pa.array([0.25] * N_ROWS, pa.float32()),
        attitude_deg=pa.nulls(N_ROWS),
    )
    found = read_histories(path)[UJB].history
    assert found.oil_temperature_c.tolist() == list(range(N_ROWS))
    assert set(found.eccentricity_ratio.tolist()) == {0.25}
    assert np.isnan(found.attitude_deg).all()


@pytest.mark.parametrize(
    ("key", "column", "says"),
    [
        ("time", columns()["time"].cast(pa.timestamp("us")), "column time of type timestamp[us]:"),
        ("time", list(range(N_ROWS)), "time of type int64: use 2026-03-01T08:00:00Z or timestamps"),
        ("time", with_value("time", None), "row 8: time is not ISO 8601"),
        ("time", pa.array([10**15] * N_ROWS, pa.timestamp("ms", tz="UTC")), "row 1: time is not"),
        ("unit", with_value("unit", None), "row 8: unit is missing"),
        ("unit", list(range(N_ROWS)), "column unit of type int64: values must be texts"),
        ("u_random", ["0.01"] * 7 + ["x"] * 13, "row 8: u_random is not a number: 'x'"),
        ("u_random", [[0.01]] * N_ROWS, "column u_random of type list"),
        ("colour", ["red"] * N_ROWS, "unknown columns: 'colour'"),
    ],
)
def test_a_wrong_column_or_cell_is_named_with_its_row(written, key, column, says):
    assert says in refusal(written(**{key: column}))


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("k_n_per_m", float("inf"), "row 8: k_n_per_m must be finite, got inf"),
        ("unit", "U 1", "row 8: unit 'U 1' must be 1 to 32 letters, digits"),
        ("time", columns()["time"][3], "row 8: time is earlier than in"),
    ],
)
def test_a_row_that_makes_no_sense_is_named_with_its_file(written, key, value, says):
    """All refusals of rows are tested with `histories_of`."""
    path = written(**{key: pa.array(with_value(key, value))})
    with pytest.raises(ReadingsError, match=says) as refused:
        read_histories(path, [UJB])
    assert str(refused.value).startswith(f"{path}: ")


def test_a_reason_says_why_a_reading_is_bad(written):
    quality = ["bad", "bad", "uncertain", *["good"] * 17]
    reason = ["insufficient_excitation", "clipped", "few_segments", *["ok"] * 17]
    found = read_histories(written(quality=quality, reason=reason))[UJB].history
    assert found.outcome[0, :4].tolist() == [1, 2, 2, 0]
    with pytest.raises(
        ReadingsError, match="row 1: quality must not be good for the reason 'clipped'"
    ):
        read_histories(written(reason=["clipped"] * N_ROWS))


def test_a_file_that_is_cut_off_anywhere_or_has_too_many_rows_is_refused(written, monkeypatch):
    path = written()
    whole = path.read_bytes()
    for size in range(4, len(whole), 97):
        path.write_bytes(whole[:size])
        assert refusal(path).startswith("damaged Parquet file: ")
    monkeypatch.setattr("service.cli.offline.backtest_tables.MAX_ROWS", N_ROWS - 1)
    assert refusal(written()) == "expected at most 19 rows, got 20; split the file"


def test_texts_that_unpack_to_more_than_memory_end_the_reading_process_only(tmp_path):
    n_rows = 60_000
    texts = pa.DictionaryArray.from_arrays(np.zeros(n_rows, np.int32), ["U" * 30_000])
    path = tmp_path / "bomb.parquet"
    pq.write_table(pa.table(columns(n_rows) | {"unit": texts}), path, compression="zstd")
    assert path.stat().st_size < 3_000_000
    with pytest.raises(ReadingsError) as refused:
        read_histories(path)
    assert str(refused.value) == f"{path}: reading requires more than 3 GiB of memory"


@pytest.mark.parametrize("n_seeds", first_fast(1, [2, 16]))
def test_a_damaged_file_is_read_or_refused_and_never_ends_the_program(written, n_seeds):
    path, random = written(), np.random.default_rng(0)
    whole = path.read_bytes()
    for _ in range(n_seeds):
        damaged = bytearray(whole)
        for at in random.integers(4, len(damaged) - 8, 6):
            damaged[at] = random.integers(256)
        path.write_bytes(bytes(damaged))
        said, n_rows = outcome(path)
        assert said.startswith(f"{path}: ") != (0 < n_rows <= N_ROWS)
        assert "\n" not in said


def outcome(path: Path) -> tuple[str, int]:
    """What was said, or how many readings were found."""
    try:
        return "", len(read_histories(path, [UJB])[UJB].history)
    except ReadingsError as error:
        return str(error), 0


def test_what_is_no_file_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "missing.csv", Path("/dev/zero")):
        with pytest.raises(ReadingsError, match=r"not a regular file|No such file"):
            read_histories(path)
