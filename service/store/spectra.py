"""Spectra over time in the database."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from core.arrays import FloatArray
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import Level, Quality, Reason, worst
from core.stiffness.order_line import marked_hz
from service.store.database import Connect, Connection
from service.store.series import series_of
from service.store.spectra_port import (
    N_CHANNELS,
    Spectra,
    SpectraLimits,
    SpectraQuery,
    StoredSpectrum,
    Tier,
    TierLimits,
)
from service.store.trends import storable

LOWEST_UM, HIGHEST_UM = 1e-6, 1e5
"""What can be told apart: smaller amplitudes read zero, larger ones this."""

N_STEPS = 65_533
STEP = math.log(HIGHEST_UM / LOWEST_UM) / N_STEPS
"""Of the logarithm: amplitudes come back within 0.02 %, which no transducer is worth."""

ZERO, UNUSABLE = 0, 65_535

CHECKSUM_BYTES = 8


def encode(amplitude_um_pk: FloatArray) -> bytes:
    """(N_CHANNELS, n_lines) amplitudes, NaN where a channel is not usable."""
    usable = np.nan_to_num(amplitude_um_pk, nan=LOWEST_UM)
    steps = np.log(np.clip(usable, LOWEST_UM, HIGHEST_UM) / LOWEST_UM) / STEP
    codes = 1 + np.round(steps).astype(np.int64)
    codes[usable < LOWEST_UM] = ZERO
    codes[np.isnan(amplitude_um_pk)] = UNUSABLE
    return codes.astype("<u2").tobytes()


def decode(amplitudes: bytes) -> FloatArray:
    """Invert `encode`."""
    codes = np.frombuffer(amplitudes, dtype="<u2").reshape(N_CHANNELS, -1)
    found: FloatArray = LOWEST_UM * np.exp(STEP * (codes.astype(np.float64) - 1.0))
    found[codes == ZERO] = 0.0
    found[codes == UNUSABLE] = np.nan
    return found


def checksum(facts: tuple[object, ...], amplitudes: bytes) -> bytes:
    """Of all that is kept of a spectrum.

    Parameters
    ----------
    facts
        Integers, floats, texts and None, just as they come back from the database.
    """
    digest = hashlib.blake2b(repr(facts).encode(), digest_size=CHECKSUM_BYTES)
    digest.update(amplitudes)
    return digest.digest()


FACTS = (
    *("series", "time_ns", "duration_s", "n_segments", "operating_state"),
    *("quality_level", "quality_reason", "speed_rpm", "power_mw"),
    *("order1_hz", "vortex_hz", "bin_hz"),
)
"""Columns that the checksum covers, besides the amplitudes."""

INSERT = f"""
    INSERT INTO spectrum (tier, slot, {", ".join(FACTS)}, amplitudes, checksum)
    VALUES ({", ".join("?" * (len(FACTS) + 4))})
"""  # noqa: S608
IS_TAKEN = "SELECT 1 FROM spectrum WHERE series = ? AND tier = ? AND slot = ?"
TRIM = """
    DELETE FROM spectrum WHERE series = :series AND tier = :tier AND id <= (
        SELECT id FROM spectrum WHERE series = :series AND tier = :tier
        ORDER BY id DESC LIMIT 1 OFFSET :n_kept
    )
"""
"""By the order of writing: a device whose clock was wrong for a while drives nothing out."""

SERIES = "SELECT id FROM series WHERE unit = ? AND bearing = ?"
IN_RANGE = """
    SELECT min(id), time_ns FROM spectrum WHERE series = ? AND time_ns >= ? AND time_ns < ?
    GROUP BY time_ns ORDER BY time_ns
"""
"""What is kept in both densities counts once."""

FIRST = "SELECT min(time_ns) FROM spectrum WHERE series = ?"
SELECT = f"SELECT {', '.join(FACTS)}, amplitudes, checksum FROM spectrum WHERE id = ?"  # noqa: S608

JUDGED = tuple(
    f"order1_{place}_{axis}_um_pk" for place in ("shaft", "bearing") for axis in ("x", "y")
)


def insert_spectra(
    writer: Connection,
    assessments: Iterable[Assessment],
    limits: SpectraLimits,
) -> None:
    """Keep the first spectrum of each stretch of time; within the writer's transaction."""
    for assessment in assessments:
        spectrum = assessment.spectrum
        if spectrum.frequency_hz.size and spectrum.n_segments.diagonal().any():
            series = series_of(writer, assessment.unit, assessment.bearing)
            for tier, its in limits.tiers:
                _insert(writer, assessment, series, (tier, its), limits.n_most_lines)


def _insert(
    writer: Connection,
    assessment: Assessment,
    series: int,
    kept: tuple[Tier, TierLimits],
    n_most_lines: int,
) -> None:
    tier, limits = kept
    slot = limits.slot(assessment.time_ns)
    if writer.execute(IS_TAKEN, (series, int(tier), slot)).fetchone():
        return
    facts = _facts(assessment, series)
    amplitudes = encode(_amplitudes(assessment)[:, :n_most_lines])
    sealed = (*facts, amplitudes, checksum(facts, amplitudes))
    writer.execute(INSERT, (int(tier), slot, *sealed))
    writer.execute(TRIM, {"series": series, "tier": int(tier), "n_kept": limits.n_most})


def _amplitudes(assessment: Assessment) -> FloatArray:
    spectrum = assessment.spectrum
    nothing = np.full(spectrum.frequency_hz.size, np.nan)
    return np.stack(
        [
            spectrum.amplitude_um_pk(place) if spectrum.n_segments[place, place] else nothing
            for place in range(N_CHANNELS)
        ]
    )


def _facts(assessment: Assessment, series: int) -> tuple[object, ...]:
    readings, condition = assessment.readings, assessment.condition
    quality = worst(readings[name].quality for name in JUDGED)
    lines_hz = [marked_hz(readings, line) for line in ("order1", "vortex")]
    return (
        series,
        int(assessment.time_ns),
        float(assessment.window.duration_s),
        int(assessment.window.n_segments),
        int(OperatingState.UNKNOWN if condition is None else condition.state),
        int(quality.level),
        quality.reason.value,
        *map(_number, (readings["speed_rpm"].value, readings["power_mw"].value, *lines_hz)),
        float(assessment.spectrum.frequency_hz[0]),
    )


def _number(value: float | None) -> float | None:
    return None if value is None else float(value)


class SqlSpectra:
    """The spectra of one database.

    Parameters
    ----------
    read
        Opens a connection for one short read.
    """

    def __init__(self, read: Connect) -> None:
        self._read = read

    def read(self, query: SpectraQuery) -> Spectra:
        """Read spectra of one bearing; those that are damaged are counted, not handed out."""
        start_ns, end_ns = storable(query.start_ns), storable(query.end_ns)
        with self._read() as reader:
            row = reader.execute(SERIES, (query.unit, query.bearing)).fetchone()
            series = -1 if row is None else int(row[0])
            found = reader.execute(IN_RANGE, (series, start_ns, end_ns)).fetchall()
            first = reader.execute(FIRST, (series,)).fetchone()[0]
            chosen = _evenly(found, query.max_spectra)
            rows = [reader.execute(SELECT, (id_,)).fetchone() for id_, _ in chosen]
        # one that was driven out between the two questions is no damage
        read = [(time_ns, row) for (_, time_ns), row in zip(chosen, rows, strict=True) if row]
        return Spectra(
            spectra=[_spectrum(row) for _, row in read if _is_whole(row)],
            n_found=len(found),
            damaged_ns=[time_ns for time_ns, row in read if not _is_whole(row)],
            first_ns=first,
        )


def _evenly(found: Sequence[tuple[int, int]], n_most: int) -> Sequence[tuple[int, int]]:
    """Of too many, those nearest to even steps of time; the first and the newest among them."""
    if len(found) <= n_most:
        return found
    time_ns = np.array([time for _, time in found], dtype=np.int64)
    wanted = np.linspace(float(time_ns[0]), float(time_ns[-1]), n_most)
    after = np.clip(np.searchsorted(time_ns, wanted), 1, time_ns.size - 1)
    before = after - 1
    nearer = np.where(wanted - time_ns[before] < time_ns[after] - wanted, before, after)
    return [found[n] for n in np.unique(nearer).tolist()]


def _is_whole(row: tuple[Any, ...]) -> bool:
    *facts, amplitudes, found = row
    return isinstance(amplitudes, bytes) and checksum(tuple(facts), amplitudes) == found


def _spectrum(row: tuple[Any, ...]) -> StoredSpectrum:
    facts = dict(zip((*FACTS, "amplitudes"), row[:-1], strict=True))
    level, reason = Level(facts["quality_level"]), Reason(facts["quality_reason"])
    same = ("time_ns", "duration_s", "n_segments", "speed_rpm", "power_mw", "bin_hz")
    return StoredSpectrum(
        **{name: facts[name] for name in (*same, "order1_hz", "vortex_hz")},
        state=OperatingState(facts["operating_state"]),
        quality=Quality(level, reason),
        amplitude_um_pk=decode(facts["amplitudes"]),
    )


SPECTRA_TABLES = """
    CREATE TABLE spectrum (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        series INTEGER NOT NULL REFERENCES series (id),
        tier INTEGER NOT NULL CHECK (tier IN (0, 1)),
        slot INTEGER NOT NULL,
        time_ns INTEGER NOT NULL,
        duration_s REAL NOT NULL,
        n_segments INTEGER NOT NULL,
        operating_state INTEGER NOT NULL,
        quality_level INTEGER NOT NULL,
        quality_reason TEXT NOT NULL,
        speed_rpm REAL,
        power_mw REAL,
        order1_hz REAL,
        vortex_hz REAL,
        bin_hz REAL NOT NULL CHECK (bin_hz > 0),
        amplitudes BLOB NOT NULL,
        checksum BLOB NOT NULL,
        UNIQUE (series, tier, slot)
    ) STRICT;
    CREATE INDEX spectrum_at ON spectrum (series, time_ns);
    CREATE INDEX spectrum_of ON spectrum (series, tier);
"""
"""Statements of the migration that brings them."""
