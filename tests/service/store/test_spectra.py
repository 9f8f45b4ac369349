"""Spectra over time: what is kept, how many, how exactly, and what becomes of damage."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigs.assessments import assessment

from core.arrays import FloatArray
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from core.quality import Level, Reason, missing
from core.spectra.cross_spectrum import CrossSpectrum
from service.settings.storage import SpectraSettings
from service.store.spectra import (
    HIGHEST_UM,
    LOWEST_UM,
    Spectra,
    SpectraQuery,
    Tier,
    decode,
    encode,
)
from service.store.sqlite import SqliteStore

S = 1_000_000_000
T0 = 1_767_225_600 * S
LIMITS = SpectraSettings(n_dense=5, n_sparse=4, n_lines=12)


def spectrum(n_lines: int = 8, scale_um: float = 1.0, lost: tuple[int, ...] = ()) -> CrossSpectrum:
    """Channel c has c + 1 times the line's number."""
    amplitude = scale_um * np.outer(np.arange(1.0, n_lines + 1), np.arange(1.0, 5.0))
    power = np.repeat(amplitude[:, :, np.newaxis] ** 2, 4, axis=2)
    usable = np.array([place not in lost for place in range(4)], dtype=np.int64)
    frequency_hz = 0.1 * np.arange(1.0, n_lines + 1)
    return CrossSpectrum(frequency_hz, power.astype(complex), power, np.outer(usable, usable))


def found(at_s: float, bearing: str = "UJB", **of_spectrum: object) -> Assessment:
    """An assessment with a spectrum, at seconds since the start."""
    made = assessment(T0 + round(at_s * S), bearing=bearing, speed_rpm=92.3, power_mw=350.0)
    condition = BearingCondition(OperatingState.PART_LOAD, True, None)
    return replace(made, spectrum=spectrum(**of_spectrum), condition=condition)  # type: ignore[arg-type]


@pytest.fixture
def kept(path: Path) -> Iterator[SqliteStore]:
    opened = SqliteStore(path, spectra=LIMITS)
    yield opened
    opened.close()


def read(store: SqliteStore, most: int = 1000, start_s: float = 0.0, end_s: float = 1e6) -> Spectra:
    start_ns, end_ns = (T0 + round(at * S) for at in (start_s, end_s))
    return store.spectra.read(SpectraQuery("U1", "UJB", start_ns, end_ns, most))


def times_s(spectra: Spectra) -> list[float]:
    return [(each.time_ns - T0) / S for each in spectra.spectra]


amplitudes = st.floats(0.0, 1e6, allow_subnormal=False)


@given(st.lists(st.tuples(*[amplitudes] * 4), min_size=1, max_size=30))
def test_an_amplitude_comes_back_within_two_hundredths_of_a_percent(lines):
    written: FloatArray = np.array(lines).T

    back = decode(encode(written))

    told = written >= LOWEST_UM
    within = np.minimum(written[told], HIGHEST_UM)
    assert np.all(np.abs(back[told] / within - 1.0) < 2.1e-4)
    assert np.all(back[~told] == 0.0)


def test_a_spectrum_comes_back_with_what_it_was_found_under(kept):
    kept.append([found(5.0)], [])

    [one] = read(kept).spectra

    assert one.time_ns == T0 + 5 * S
    assert (one.speed_rpm, one.power_mw, one.order1_hz) == (92.3, 350.0, None)
    assert (one.state, one.n_segments, one.duration_s) == (OperatingState.PART_LOAD, 1, 13.653)
    assert (one.quality.level, one.quality.reason) == (Level.BAD, Reason.NOT_MEASURED)
    assert one.bin_hz == pytest.approx(0.1)
    expected = np.outer(np.arange(1.0, 5.0), np.arange(1.0, 9.0))
    assert one.amplitude_um_pk == pytest.approx(expected, rel=2.1e-4)


def test_a_channel_that_was_not_usable_has_no_amplitudes_rather_than_none_moving(kept):
    kept.append([found(0.0, lost=(1,)), found(120.0, lost=(0, 1, 2, 3))], [])

    [one] = read(kept).spectra

    assert np.isnan(one.amplitude_um_pk).all(axis=1).tolist() == [False, True, False, False]


def test_the_first_spectrum_of_each_minute_is_kept_and_no_other(kept):
    kept.append([found(12.0 * n) for n in range(16)], [])
    kept.append([found(12.0 * n) for n in range(16)], [])  # the answer to the first got lost

    assert times_s(read(kept)) == [0.0, 60.0, 120.0, 180.0]


def test_old_spectra_thin_out_and_their_number_stays_bounded(kept, execute):
    for minute in range(60):
        kept.append([found(60.0 * minute), found(60.0 * minute, "LJB")], [])

    spectra = read(kept)

    sparse, dense = [1200.0, 1800.0, 2400.0, 3000.0], [3300.0, 3360.0, 3420.0, 3480.0, 3540.0]
    assert times_s(spectra) == [*sparse, *dense]
    assert spectra.first_ns == T0 + 1200 * S
    per_tier = dict(execute("SELECT tier, count(*) FROM spectrum GROUP BY tier"))
    assert per_tier == {Tier.DENSE: 10, Tier.SPARSE: 8}


def test_a_clock_that_was_years_ahead_for_a_while_drives_nothing_out(kept):
    for n in range(5):
        kept.append([found(3e8 + 60.0 * n)], [])
    for n in range(5):
        kept.append([found(60.0 * n)], [])

    assert times_s(read(kept)) == [0.0, 60.0, 120.0, 180.0, 240.0]


def test_spectra_are_there_after_a_restart_and_a_minute_is_not_kept_twice(path):
    for at_s in (0.0, 30.0, 60.0):
        with closing(SqliteStore(path, spectra=LIMITS)) as store:
            store.append([found(at_s)], [])

    with closing(SqliteStore(path, spectra=LIMITS)) as store:
        assert times_s(read(store)) == [0.0, 60.0]


def test_a_gap_in_the_samples_is_a_gap_in_the_spectra(kept):
    kept.append([found(at_s) for at_s in (0.0, 60.0, 86_400.0)], [])

    assert times_s(read(kept)) == [0.0, 60.0, 86_400.0]
    assert times_s(read(kept, start_s=60.0, end_s=86_400.0)) == [60.0]


def test_of_too_many_spectra_those_that_lie_evenly_in_time_are_read(path):
    with closing(SqliteStore(path)) as store:
        store.append([found(60.0 * n) for n in range(101)], [])

        spectra = read(store, most=5)

    assert spectra.n_found == 101
    assert times_s(spectra) == [0.0, 1500.0, 3000.0, 4500.0, 6000.0]


def test_lines_beyond_the_limit_are_not_kept(kept):
    kept.append([found(0.0, n_lines=50)], [])

    assert read(kept).spectra[0].resolution == (0.1, 12)


@pytest.mark.parametrize(
    "damage",
    [
        "amplitudes = zeroblob(length(amplitudes))",
        "amplitudes = substr(amplitudes, 1, 17)",
        "speed_rpm = 93.2",
        "order1_hz = 1.5",
        "operating_state = 99",
        "checksum = zeroblob(8)",
    ],
)
def test_a_damaged_spectrum_is_told_of_and_not_handed_out(kept, execute, damage):
    kept.append([found(0.0), found(60.0)], [])
    execute(f"UPDATE spectrum SET {damage} WHERE time_ns = {T0 + 60 * S}")  # noqa: S608

    spectra = read(kept)

    assert times_s(spectra) == [0.0]
    assert list(spectra.damaged_ns) == [T0 + 60 * S]


def test_a_result_without_a_spectrum_is_stored_without_one(kept):
    empty = np.empty((0, 4, 4))
    none = CrossSpectrum(np.empty(0), empty.astype(complex), empty, np.zeros((4, 4), np.int64))
    kept.append([replace(assessment(T0, speed_rpm=missing(Reason.STALE)), spectrum=none)], [])

    assert read(kept).spectra == []
    assert kept.newest("U1", "UJB") is not None
