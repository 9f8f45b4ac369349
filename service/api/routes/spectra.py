"""Spectra of a bearing: the newest, and spectra over time."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
import structlog
from fastapi import APIRouter, Query, Response
from pydantic import Field

from core.arrays import FloatArray
from core.monitor.assessment import Assessment
from core.stiffness.order_line import marked_hz
from core.units import NS_PER_S
from service.api.answers import Renderings, rendered
from service.api.auth.declared import needs
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import TimeRange
from service.api.problems import ProblemError, problem_responses
from service.api.routes.bearings import no_result
from service.api.values import (
    LEVEL_NAMES,
    PLACES,
    STATE_NAMES,
    ApiModel,
    LevelName,
    OperatingStateName,
    PlaceName,
    Time,
)
from service.runtime.times import rfc3339
from service.store.access.identities import Permission
from service.store.spectra import Spectra, SpectraQuery, StoredSpectrum


class PlaceSpectraModel(ApiModel):
    """Spectra of one channel over time."""

    unit: Literal["um_pk"]
    """Displacement, zero to peak."""

    amplitude: list[list[float] | None]
    """One value per frequency for each time; null where the channel was not usable."""


class SpectraModel(ApiModel):
    """Averaged amplitude spectra of a bearing over time, oldest first."""

    unit: str
    """Identifier of the unit."""

    bearing: str
    """Identifier of the bearing."""

    start: Time
    """Start of the requested range."""

    end: Time
    """End of the requested range."""

    frequency_hz: Annotated[list[float], Field(examples=[[0.073, 0.146, 0.22]])]
    """Frequencies of the lines of all spectra."""

    time: list[float]
    """Seconds since 1970 UTC: end of the samples of each spectrum."""

    duration_s: list[float]
    """Length of the averaged samples, s."""

    speed_rpm: list[float | None]
    """Running speed, r/min; null if unknown."""

    power_mw: list[float | None]
    """Active power, MW; null if unknown."""

    operating_state: list[OperatingStateName]
    """Operating state of the unit."""

    level: list[LevelName]
    """Worst quality of the 1× amplitudes."""

    reason: list[str]
    """Reason of that quality; "ok" if it is good."""

    order1_hz: list[float | None]
    """Frequency of 1×."""

    vortex_hz: list[float | None]
    """Frequency of the vortex."""

    channels: dict[PlaceName, PlaceSpectraModel]
    """Requested channels."""

    n_found: int
    """Spectra stored in this range; more than `max_spectra` are thinned evenly."""

    n_other_resolution: int
    """Spectra left out because their frequencies differ from those of the newest one, after a
    change of the settings."""

    damaged: list[Time]
    """Spectra left out because they are damaged on the disk."""

    first: Time | None
    """Time of the oldest stored spectrum of this bearing; null if there is none."""

    simulated_until: Time | None
    """End of the simulated readings of this bearing, which have no spectra; null if all are
    measured."""


class SpectrumChannelModel(ApiModel):
    """Amplitude spectrum of one channel."""

    unit: Literal["um_pk"]
    """Displacement, zero to peak."""

    amplitude: list[float] | None
    """A value for each frequency; null if the channel is not usable."""


class SpectrumModel(ApiModel):
    """Averaged amplitude spectra of a bearing, as displacement."""

    time: Time
    """End of the samples."""

    frequency_hz: list[float]
    """Frequencies of the lines."""

    channels: dict[str, SpectrumChannelModel]
    """shaft_x, shaft_y, bearing_x and bearing_y."""

    lines: dict[str, float | None]
    """Frequencies of order1 (1×) and of the vortex."""


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
    """Return the spectra with the resolution of the newest one.

    Raises
    ------
    ProblemError
        If they are too large for one answer.
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
            f"{n_spectra} spectra of {n_numbers} amplitudes exceed one answer; request at most"
            f" {max(2, MAX_NUMBERS // n_numbers)} spectra, fewer channels, or a lower"
            " max_frequency_hz"
        )
        raise ProblemError(422, "Wrong parameter", detail, "max_spectra")


def _place(shown: Sequence[StoredSpectrum], place: PlaceName, n_lines: int) -> PlaceSpectraModel:
    rows = [each.amplitude_um_pk[PLACES[place], :n_lines] for each in shown]
    amplitude = [None if np.isnan(row).any() else np.round(row, DECIMALS).tolist() for row in rows]
    return PlaceSpectraModel(unit="um_pk", amplitude=amplitude)


def spectrum_model(assessment: Assessment) -> SpectrumModel:
    """Return the amplitude spectra of an assessment."""
    spectrum, readings = assessment.spectrum, assessment.readings
    return SpectrumModel(
        time=rfc3339(assessment.time_ns),
        frequency_hz=spectrum.frequency_hz.tolist(),
        channels={
            name: SpectrumChannelModel(
                unit="um_pk",
                amplitude=spectrum.amplitude_um_pk(place).tolist()
                if spectrum.n_segments[place, place]
                else None,
            )
            for name, place in PLACES.items()
        },
        lines={name: marked_hz(readings, name) for name in ("order1", "vortex")},
    )


MAX_SPECTRA = 1000

log = structlog.get_logger()


def spectra_router(context: Context) -> APIRouter:
    """Return the routes of spectra."""
    router = APIRouter(
        prefix="/api/v1/units/{unit}/bearings",
        tags=["bearing"],
        dependencies=[needs(Permission.READ)],
    )
    newest = Renderings()

    @router.get(
        "/{bearing}/spectrum",
        summary="Spectra",
        response_model=SpectrumModel,
        responses=problem_responses(404, 409),
    )
    async def spectrum(unit: UnitId, bearing: BearingId) -> Response:
        """Show averaged amplitude spectra of the newest result, all channels as displacement."""
        context.bearing(unit, bearing)
        assessment = context.live.assessment(unit, bearing)
        if assessment is None:
            raise no_result(unit, bearing)
        return await newest.of((unit, bearing), assessment, spectrum_model)

    @router.get(
        "/{bearing}/spectra",
        summary="Spectra over time",
        response_model=SpectraModel,
        responses=problem_responses(404, 422, 503),
    )
    async def spectra(
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        channel: Annotated[
            list[PlaceName] | None,
            Query(
                max_length=8,
                description="Channels; default: all. May be repeated.",
                examples=[["shaft_x"]],
            ),
        ] = None,
        max_spectra: Annotated[
            int,
            Query(ge=2, le=MAX_SPECTRA, description="Maximum number; more are thinned evenly."),
        ] = 200,
        max_frequency_hz: Annotated[
            float | None,
            Query(gt=0.0, allow_inf_nan=False, description="Highest frequency.", examples=[6.0]),
        ] = None,
    ) -> Response:
        """List stored averaged amplitude spectra, all channels as displacement.

        Each is a spectrum of one time, not a mean or maximum until the next.
        """
        context.bearing(unit, bearing)
        places = list(dict.fromkeys(channel or PLACES))
        query = SpectraQuery(unit, bearing, *times, max_spectra)
        return await rendered(lambda: _read(context, query, places, max_frequency_hz))

    return router


def _read(
    context: Context, query: SpectraQuery, places: list[PlaceName], max_frequency_hz: float | None
) -> SpectraModel:
    found = context.store.spectra.read(query)
    if found.damaged_ns:
        log.error(
            "spectra are damaged", unit=query.unit, bearing=query.bearing, n=len(found.damaged_ns)
        )
    past_end_ns = context.store.films.past_end_ns(query.unit, query.bearing)
    return spectra_model(query, found, places, max_frequency_hz, past_end_ns)
