"""Spectra over time in the words of the API."""

from collections.abc import Sequence

import numpy as np

from core.arrays import FloatArray
from core.units import NS_PER_S
from service.api.film_conditions import STATE_NAMES
from service.api.problems import ProblemError
from service.api.series_models import PlaceName
from service.api.spectra_models import PlaceSpectraModel, SpectraModel
from service.api.views import LEVEL_NAMES, PLACES
from service.runtime.times import rfc3339
from service.store.spectra_port import Spectra, SpectraQuery, StoredSpectrum

MAX_NUMBERS = 2_000_000
"""Amplitudes in one answer; 20 MB of it."""

DECIMALS = 6
"""Of amplitudes in µm; spectra are kept to less."""


def spectra_model(
    query: SpectraQuery,
    found: Spectra,
    places: Sequence[PlaceName],
    max_frequency_hz: float | None,
    past_end_ns: int | None,
) -> SpectraModel:
    """Spectra of one resolution, that of the newest one.

    Raises
    ------
    ProblemError
        If they are too much for one answer.
    """
    shown = [each for each in found.spectra if each.resolution == found.spectra[-1].resolution]
    frequency_hz = _frequencies(shown, max_frequency_hz)
    _require_few(len(shown), len(places) * frequency_hz.size)
    return SpectraModel(
        unit=query.unit,
        bearing=query.bearing,
        start=rfc3339(query.start_ns),
        end=rfc3339(query.end_ns),
        frequency_hz=frequency_hz.tolist(),
        time=[each.time_ns / NS_PER_S for each in shown],
        duration_s=[each.duration_s for each in shown],
        speed_rpm=[each.speed_rpm for each in shown],
        power_mw=[each.power_mw for each in shown],
        operating_state=[STATE_NAMES[each.state] for each in shown],
        level=[LEVEL_NAMES[each.quality.level] for each in shown],
        reason=[each.quality.reason.value for each in shown],
        order1_hz=[each.order1_hz for each in shown],
        vortex_hz=[each.vortex_hz for each in shown],
        channels={place: _place(shown, place, frequency_hz.size) for place in places},
        n_found=found.n_found,
        n_other_resolution=len(found.spectra) - len(shown),
        damaged=[rfc3339(time_ns) for time_ns in found.damaged_ns],
        first=None if found.first_ns is None else rfc3339(found.first_ns),
        simulated_until=None if past_end_ns is None else rfc3339(past_end_ns),
    )


def _frequencies(shown: Sequence[StoredSpectrum], max_frequency_hz: float | None) -> FloatArray:
    if not shown:
        return np.empty(0)
    bin_hz, n_lines = shown[-1].resolution
    frequency_hz: FloatArray = bin_hz * np.arange(1, n_lines + 1, dtype=np.float64)
    return (
        frequency_hz if max_frequency_hz is None else frequency_hz[frequency_hz <= max_frequency_hz]
    )


def _require_few(n_spectra: int, n_numbers: int) -> None:
    if n_spectra * n_numbers > MAX_NUMBERS:
        detail = (
            f"{n_spectra} spectra of {n_numbers} amplitudes are too much, at most"
            f" {max(2, MAX_NUMBERS // n_numbers)} are given at once; or ask for fewer channels, or"
            " a lower max_frequency_hz"
        )
        raise ProblemError(422, "Wrong parameter", detail, "max_spectra")


def _place(shown: Sequence[StoredSpectrum], place: PlaceName, n_lines: int) -> PlaceSpectraModel:
    rows = [each.amplitude_um_pk[PLACES[place], :n_lines] for each in shown]
    amplitude = [None if np.isnan(row).any() else np.round(row, DECIMALS).tolist() for row in rows]
    return PlaceSpectraModel(unit="um_pk", amplitude=amplitude)
