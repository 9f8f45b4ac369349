"""Files of readings: a few rows as text, and years of simulated units."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq
import pytest
from rigs.tiers import first_fast

from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.life import live
from acquisition.simulated.life.truth import UnitLife
from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.change.backtest import operation_history
from core.condition.operating_state import OperatingLimits, OperatingState

DAY_NS = 86_400 * 10**9
START_NS = 19_723 * DAY_NS
"""Midnight of 1 January 2024."""

HEADINGS = (
    "time,unit,bearing,direction,k_n_per_m,u_random,eccentricity_ratio,oil_temperature_c,"
    "state,quality"
)
EVIDENCE_NAMES = {
    ReadingOutcome.MEASURED: "good",
    ReadingOutcome.INSUFFICIENT_EXCITATION: "insufficient_excitation",
    ReadingOutcome.BAD_QUALITY: "bad",
}


def row(minute: int, **changes: str) -> str:
    """A line of a file, good unless changed."""
    cells = {
        "time": f"2025-01-01T{minute // 60:02d}:{minute % 60:02d}:00Z",
        "unit": "U1",
        "bearing": "UJB",
        "direction": "x",
        "k_n_per_m": "1e9",
        "u_random": "0.01",
        "eccentricity_ratio": "0.3",
        "oil_temperature_c": "40.5",
        "state": "part_load",
        "quality": "good",
    }
    return ",".join((cells | changes).values())


@pytest.fixture(scope="session")
def line() -> Callable[..., str]:
    """Makes a line of a file."""
    return row


@pytest.fixture(scope="session")
def text() -> Callable[..., str]:
    """Makes a file of lines, ten good ones before those given."""

    def file(*lines: str) -> str:
        return "\n".join([HEADINGS, *(row(10 * n) for n in range(10)), *lines]) + "\n"

    return file


@dataclass(frozen=True)
class TwoUnits:
    """Two simulated units and the same readings in two files; U2 loses stiffness in one bearing.

    Baselines are learned from `learning_days`; the damage comes at `damaged_ns`.
    """

    learning_days: int
    damaged_ns: int
    lives: Mapping[str, UnitLife]
    csv: Path
    parquet: Path


@pytest.fixture(scope="session", params=first_fast(1, [(90, 110, 0.45), (365, 400, 1.3)]), ids=str)
def two_units(tmp_path_factory, request) -> Iterator[TwoUnits]:
    learning_days, damaged_day, years = request.param
    damaged_ns = START_NS + damaged_day * DAY_NS
    folder = tmp_path_factory.mktemp("two_units")
    damage = Damage(DamageKind.STIFFNESS_LOSS, "LJB", damaged_ns, 0.15)
    lives = {
        "U1": live(1000, START_NS, years),
        "U2": live(1001, START_NS, years, [damage]),
    }
    table = pa.concat_tables(_table(name, life) for name, life in lives.items())
    found = TwoUnits(
        learning_days, damaged_ns, lives, folder / "readings.csv", folder / "readings.parquet"
    )
    pq.write_table(table, found.parquet)
    times = np.char.add(np.datetime_as_string(table["time"].to_numpy()), "Z")
    pacsv.write_csv(table.set_column(0, "time", pa.array(times)), found.csv)
    yield found
    found.csv.unlink()
    found.parquet.unlink()


def told_states(life: UnitLife) -> Any:
    """(n,) members of `OperatingState`."""
    operation = life.operation
    limits = OperatingLimits(operation.rated_speed_rpm, operation.rated_power_mw)
    return operation_history(
        operation.time_ns, operation.speed_rpm, operation.power_mw, limits
    ).state


def _table(unit: str, life: UnitLife) -> Any:
    states = np.array([state.name.lower() for state in OperatingState])[told_states(life)]
    qualities = np.array([EVIDENCE_NAMES[evidence] for evidence in ReadingOutcome])
    return pa.concat_tables(
        pa.table(
            {
                "time": pa.array(history.time_ns).cast(pa.timestamp("ns", tz="UTC")),
                "unit": [unit] * len(history),
                "bearing": [bearing] * len(history),
                "direction": [direction] * len(history),
                "k_n_per_m": np.exp(history.ln_k[side]),
                "u_random": history.u_random[side],
                "eccentricity_ratio": history.eccentricity_ratio,
                "oil_temperature_c": history.oil_temperature_c,
                "attitude_deg": history.attitude_deg,
                "shaft_um_pk": history.shaft_um_pk[side],
                "bearing_um_pk": history.bearing_um_pk[side],
                "state": states,
                "quality": qualities[history.outcome[side]],
            }
        )
        for bearing, history in life.readings.items()
        for side, direction in enumerate(DIRECTIONS)
    )
