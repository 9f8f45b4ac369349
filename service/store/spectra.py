"""Store of averaged vibration spectra of bearings."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from core.arrays import FloatArray
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import Level, Quality, Reason, worst
from core.stiffness.order_line import marked_hz
from core.units import ns_from_s
from service.settings.storage import SpectraSettings
from service.store.database import Connection, Tables, insert
from service.store.series import find_series, series_of
from service.store.trends import storable

N_CHANNELS = 4
"""Number of channels of a bearing: shaft x and y, bearing x and y."""


class Tier(IntEnum):
    """Storage tier of spectra by time resolution; the value is the number in the database."""

    DENSE = 0
    SPARSE = 1


@dataclass(frozen=True)
class SpectraQuery:
    """Query for spectra of one bearing.

    Parameters
    ----------
    start_ns, end_ns
        Half-open time range, ns since 1970 UTC.
    max_spectra
        Maximum number of spectra; if more are stored, spectra evenly spaced in time are chosen.
    """

    unit: str
    bearing: str
    start_ns: int
    end_ns: int
    max_spectra: int


@dataclass(frozen=True, eq=False)
class StoredSpectrum:
    """Averaged spectra of the channels of a bearing.

    Parameters
    ----------
    time_ns
        Time of the end of the averaged samples, in ns since 1970 UTC.
    duration_s
        Duration of the averaged samples.
    n_segments
        Number of segments in which all channels were usable.
    quality
        Worst quality of the 1× amplitudes.
    order1_hz
        Frequency of the 1× line; None if unknown.
    vortex_hz
        Frequency of the vortex line; None if unknown.
    bin_hz
        Line spacing, which is also the frequency of the first spectral line.
    amplitude_um_pk : (N_CHANNELS, n_lines)
        Displacement amplitudes; all NaN for an unusable channel.
    """

    time_ns: int
    duration_s: float
    n_segments: int
    state: OperatingState
    quality: Quality
    speed_rpm: float | None
    power_mw: float | None
    order1_hz: float | None
    vortex_hz: float | None
    bin_hz: float
    amplitude_um_pk: FloatArray

    @property
    def resolution(self) -> tuple[float, int]:
        """Line spacing in Hz and number of lines, which define the frequency axis."""
        return self.bin_hz, self.amplitude_um_pk.shape[1]


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of one bearing, oldest first.

    Parameters
    ----------
    n_found
        Number of stored spectra in the time range, regardless of `max_spectra`.
    damaged_ns
        Times of chosen spectra with a wrong checksum, which are omitted.
    first_ns
        Time of the oldest stored spectrum of the bearing, also outside the time range; None
        without spectra.
    """

    spectra: Sequence[StoredSpectrum]
    n_found: int
    damaged_ns: Sequence[int]
    first_ns: int | None


LOWEST_UM, HIGHEST_UM = 1e-6, 1e5
"""Range of stored amplitudes, µm; smaller ones are stored as zero, larger ones as the maximum."""

N_STEPS = 65_533
STEP = math.log(HIGHEST_UM / LOWEST_UM) / N_STEPS
"""Logarithmic step of stored amplitudes, 0.04 %; rounding errors are below 0.02 %."""

ZERO, UNUSABLE = 0, 65_535

CHECKSUM_BYTES = 8


def encode(amplitude_um_pk: FloatArray) -> bytes:
    """Return amplitudes (N_CHANNELS, n_lines) in µm, NaN if unusable, as logarithmic 16-bit codes.

    Values below `LOWEST_UM` become 0; values above `HIGHEST_UM` become `HIGHEST_UM`.
    """
    usable = np.nan_to_num(amplitude_um_pk, nan=LOWEST_UM)
    steps = np.log(np.clip(usable, LOWEST_UM, HIGHEST_UM) / LOWEST_UM) / STEP
    codes = 1 + np.round(steps).astype(np.int64)
    codes[usable < LOWEST_UM] = ZERO
    codes[np.isnan(amplitude_um_pk)] = UNUSABLE
    return codes.astype("<u2").tobytes()


def decode(amplitudes: bytes) -> FloatArray:
    """Return the (N_CHANNELS, n_lines) amplitudes in µm; the inverse of `encode`."""
    codes = np.frombuffer(amplitudes, dtype="<u2").reshape(N_CHANNELS, -1)
    found: FloatArray = LOWEST_UM * np.exp(STEP * (codes.astype(np.float64) - 1.0))
    found[codes == ZERO] = 0.0
    found[codes == UNUSABLE] = np.nan
    return found


def checksum(facts: tuple[object, ...], amplitudes: bytes) -> bytes:
    """Return the checksum of the columns and amplitudes of a stored spectrum.

    Parameters
    ----------
    facts
        Values of the columns `FACTS`, exactly as the database returns them.
    """
    digest = hashlib.blake2b(repr(facts).encode(), digest_size=CHECKSUM_BYTES)
    digest.update(amplitudes)
    return digest.digest()


FACTS = (
    *("series", "time_ns", "duration_s", "n_segments", "operating_state"),
    *("quality_level", "quality_reason", "speed_rpm", "power_mw"),
    *("order1_hz", "vortex_hz", "bin_hz"),
)
"""Columns that the checksum covers in addition to the amplitudes."""

INSERT = insert("spectrum", ("tier", "slot", *FACTS, "amplitudes", "checksum"))
IS_TAKEN = "SELECT 1 FROM spectrum WHERE series = ? AND tier = ? AND slot = ?"
TRIM = """
    DELETE FROM spectrum WHERE series = :series AND tier = :tier AND id <= (
        SELECT id FROM spectrum WHERE series = :series AND tier = :tier
        ORDER BY id DESC LIMIT 1 OFFSET :n_kept
    )
"""
"""Statement that deletes spectra in order of insertion, since the clock may have been wrong."""

IN_RANGE = """
    SELECT min(id), time_ns FROM spectrum WHERE series = ? AND time_ns >= ? AND time_ns < ?
    GROUP BY time_ns ORDER BY time_ns
"""
"""Query of the spectra in a range; a spectrum that is stored in both tiers is returned once."""

FIRST = "SELECT min(time_ns) FROM spectrum WHERE series = ?"
SELECT = f"SELECT {', '.join(FACTS)}, amplitudes, checksum FROM spectrum WHERE id = ?"  # noqa: S608

JUDGED = tuple(
    f"order1_{place}_{axis}_um_pk" for place in ("shaft", "bearing") for axis in ("x", "y")
)


def insert_spectra(
    writer: Connection, assessments: Iterable[Assessment], limits: SpectraSettings
) -> None:
    """Insert the first spectrum of each interval of each tier; delete spectra beyond the limit.

    Assessments without a spectrum are skipped.
    """
    tiers = (
        (Tier.DENSE, limits.dense_every_s, limits.n_dense),
        (Tier.SPARSE, limits.sparse_every_s, limits.n_sparse),
    )
    for assessment in assessments:
        spectrum = assessment.spectrum
        if spectrum.frequency_hz.size and spectrum.n_segments.diagonal().any():
            series = series_of(writer, assessment.unit, assessment.bearing)
            for tier, every_s, n_kept in tiers:
                key = (series, int(tier), assessment.time_ns // ns_from_s(every_s))
                if not writer.execute(IS_TAKEN, key).fetchone():
                    facts = _facts(assessment, series)
                    amplitudes = encode(_amplitudes(assessment)[:, : limits.n_lines])
                    row = (*key[1:], *facts, amplitudes, checksum(facts, amplitudes))
                    writer.execute(INSERT, row)
                    kept = {"series": series, "tier": int(tier), "n_kept": n_kept}
                    writer.execute(TRIM, kept)


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


class SpectraStore(Tables):
    """Read access to the averaged spectra of bearings; `Store.append` writes the spectra."""

    def read(self, query: SpectraQuery) -> Spectra:
        """Return the intact spectra that match a query, and the times of damaged spectra."""
        start_ns, end_ns = storable(query.start_ns), storable(query.end_ns)
        with self._reading() as reader:
            series = find_series(reader, query.unit, query.bearing)
            found = reader.execute(IN_RANGE, (series, start_ns, end_ns)).fetchall()
            first = reader.execute(FIRST, (series,)).fetchone()[0]
            chosen = _evenly(found, query.max_spectra)
            rows = [reader.execute(SELECT, (id_,)).fetchone() for id_, _ in chosen]
        # a spectrum that was deleted between the two queries is not damaged
        read = [(time_ns, row) for (_, time_ns), row in zip(chosen, rows, strict=True) if row]
        return Spectra(
            spectra=[_spectrum(row) for _, row in read if _is_whole(row)],
            n_found=len(found),
            damaged_ns=[time_ns for time_ns, row in read if not _is_whole(row)],
            first_ns=first,
        )


def _evenly(found: Sequence[tuple[int, int]], n_most: int) -> Sequence[tuple[int, int]]:
    """Return at most `n_most` entries evenly spaced in time, including the first and the last."""
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
"""Migration that creates the table of spectra."""
