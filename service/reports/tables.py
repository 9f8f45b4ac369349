"""Parquet tables of a bundle: spectra, orbits, and readings of the film before the alarm."""

from collections.abc import Iterable
from io import BytesIO
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from core.change.decision import Verdict
from core.monitor.assessment import Assessment
from core.spectra.cross_spectrum import CrossSpectrum
from service.reports.parts import AXES
from service.store.film_readings import FilmHistory

SPECTRA, ORBITS, TREND = "spectra.parquet", "orbits.parquet", "trend.parquet"

CHANNELS = ("shaft_x", "shaft_y", "bearing_x", "bearing_y")
"""Names of the channels of a cross-spectrum, in order."""

WORDS = np.array([verdict.name.lower() for verdict in Verdict])

AnyArray = npt.NDArray[Any]

Columns = dict[str, list[Any]]
"""Table as lists of values by column name."""


class TableError(Exception):
    """Error raised if a table of a bundle cannot be read; the message states file and reason."""


def spectra_table(found: Iterable[Assessment]) -> bytes:
    """Return the spectra of one or more bearings as a Parquet table, one row per spectral line.

    The columns are bearing, frequency in Hz, amplitudes in µm zero-to-peak, real and imaginary
    parts of the cross-spectra in µm², and the squared coherence of shaft and bearing in x and y.
    """
    tables = [_spectrum(each.bearing, each.spectrum) for each in found]
    return _written(pa.concat_tables(tables))


def orbits_table(found: Iterable[Assessment]) -> bytes | None:
    """Return the newest shaft orbits of bearings as a Parquet table; None without samples.

    The columns are bearing, time in s from the first sample, and shaft motion in x and y in µm.
    """
    tables = [
        pa.table(
            {
                "bearing": pa.array([each.bearing] * orbit.shaft_x_um.size).dictionary_encode(),
                "time_s": np.arange(orbit.shaft_x_um.size) / orbit.rate_hz,
                "shaft_x_um": orbit.shaft_x_um,
                "shaft_y_um": orbit.shaft_y_um,
            }
        )
        for each in found
        if (orbit := each.orbit) is not None
    ]
    return _written(pa.concat_tables(tables)) if tables else None


OPERATION = ("speed_rpm", "power_mw", "eccentricity_ratio", "attitude_deg", "oil_temperature_c")
MEASURED = ("u_random", "shaft_um_pk", "bearing_um_pk")
CHANGES = ("change", "change_std", "deviation", "deviation_std")
"""Columns with two rows of stiffness, then two of damping over stiffness."""


def trend_table(found: FilmHistory) -> bytes:
    """Return the readings of a film as a Parquet table, one row per reading, oldest first.

    The columns are time, operating condition and baseline version; and for x and y the stiffness in
    N/m, damping over stiffness in s, amplitudes in µm, verdict, alarm level, and deviations from
    the baseline in ln. NaN becomes null.
    """
    return _written(_trend(found))


def _trend(found: FilmHistory) -> "pa.Table":
    history = found.history
    shared: dict[str, AnyArray] = {
        "time_ns": history.time_ns,
        "operating_state": found.state,
        **{name: getattr(found, name) for name in ("is_settled", "is_simulated")},
        **{name: getattr(history, name) for name in OPERATION},
        "baseline_version": found.baseline_version,
    }
    pairs: dict[str, AnyArray] = {
        f"{name}_{axis}": column[row]
        for row, axis in enumerate(AXES)
        for name, column in (
            ("stiffness", np.exp(history.ln_k)),
            *((name, getattr(history, name)) for name in MEASURED),
            ("verdict", WORDS[found.verdict]),
            ("level", found.level),
            *((name, getattr(found, name)) for name in CHANGES),
            ("ck_s", np.exp(history.ln_ck)),
            ("u_ck", history.u_ck),
            *((f"ck_{name}", getattr(found, name)[2:]) for name in CHANGES),
            ("ck_verdict", WORDS[found.verdict[2:]]),
            ("ck_level", found.level[2:]),
        )
    }
    return pa.table({name: _column(each) for name, each in (shared | pairs).items()})


def trend_columns(found: FilmHistory) -> Columns:
    """Return the columns of the table of `trend_table` as lists, by name; NaN becomes None."""
    columns: Columns = _trend(found).to_pydict()
    return columns


def read_table(path: Path) -> Columns:
    """Read a Parquet table of a bundle; null becomes None.

    Raises `TableError` if the file is missing or cannot be read.
    """
    try:
        columns: Columns = pq.read_table(path, memory_map=False).to_pydict()
    except (OSError, pa.ArrowException) as error:
        raise TableError(f"{path.name}: {error}; restore a backup") from error
    return columns


def _spectrum(bearing: str, found: CrossSpectrum) -> "pa.Table":
    n = found.frequency_hz.size
    columns = {
        "bearing": pa.array([bearing] * n).dictionary_encode(),
        "frequency_hz": found.frequency_hz,
    }
    columns |= {
        f"{name}_um_pk": found.amplitude_um_pk(place) for place, name in enumerate(CHANNELS)
    }
    columns |= {
        f"{part}_{CHANNELS[i]}_{CHANNELS[j]}_um2": column
        for i, j in combinations(range(len(CHANNELS)), 2)
        for part, column in (
            ("re", np.ascontiguousarray(found.matrix[:, i, j].real)),
            ("im", np.ascontiguousarray(found.matrix[:, i, j].imag)),
        )
    }
    columns |= {
        f"coherence_{axis}": found.coherence(place, place + 2) for place, axis in enumerate(AXES)
    }
    return pa.table(columns)


def _column(values: AnyArray) -> "pa.Array":
    return pa.array(np.ascontiguousarray(values), from_pandas=True)  # NaN becomes null


def _written(table: "pa.Table") -> bytes:
    sink = BytesIO()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue()
