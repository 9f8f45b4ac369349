"""Routes for the amplitude spectra of a bearing: newest spectra, and stored spectra over time."""

import asyncio
from collections.abc import Sequence
from functools import partial
from typing import Annotated, Literal

import numpy as np
import structlog
from fastapi import Request, Response
from pydantic import Field

from core.monitor.assessment import Assessment
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y, CrossSpectrum
from core.stiffness.order_line import marked_hz
from service.api.auth.gate import GuardedRouter, subject_router
from service.api.context import BearingId, Context, UnitId
from service.api.parameters import TimeRange, at_most, parameter, several
from service.api.problems import ProblemError, problem_responses
from service.api.values import (
    LEVEL_NAMES,
    PLACES,
    STATE_NAMES,
    ApiModel,
    BearingHistory,
    LevelName,
    OperatingStateName,
    PlaceName,
    Time,
)
from service.settings.core_values import machine_of
from service.store.spectra import SpectraQuery, StoredSpectrum


class AmplitudeModel(ApiModel):
    """Base class of amplitude spectra."""

    unit: Literal["um_pk"]
    """Unit of the amplitudes: µm of displacement, zero to peak; of full spectra the radius."""


class PlaceSpectraModel(AmplitudeModel):
    """Amplitude spectra of one channel over time."""

    amplitude: list[list[float] | None]
    """Amplitudes as one list per time; null for a time at which the channel was not usable."""


class SpectraModel(BearingHistory):
    """Averaged amplitude spectra of a bearing over time, oldest first."""

    frequency_hz: Annotated[list[float], Field(examples=[[0.073, 0.146, 0.22]])]
    duration_s: list[float]
    speed_rpm: list[float | None]
    power_mw: list[float | None]
    operating_state: list[OperatingStateName]
    n_found: int
    simulated_until: Time | None

    time: list[Time]
    """End of the samples of each spectrum."""

    level: list[LevelName]
    """Worst quality level of the 1× amplitudes at each time."""

    reason: list[str]
    """Reason for the quality level; "ok" if the level is good."""

    order1_hz: list[float | None]
    """Frequency of 1×, Hz; null if unknown."""

    vortex_hz: list[float | None]
    """Frequency of the vortex, Hz; null if unknown."""

    channels: dict[PlaceName, PlaceSpectraModel]
    """Spectra of the requested channels, by channel."""

    n_other_resolution: int
    """Number of spectra left out because their frequencies differ from those of the newest
    spectrum, after a change of the settings."""

    damaged: list[Time]
    """Times of spectra that are left out because their stored data are damaged."""

    first: Time | None
    """Time of the oldest stored spectrum of this bearing; null without stored spectra."""


class SpectrumChannelModel(AmplitudeModel):
    """Amplitude spectrum of one channel."""

    amplitude: list[float] | None
    """Amplitude at each frequency; null if the channel is not usable."""


class FullSpectrumModel(AmplitudeModel):
    """Full spectrum of a pair of channels: forward and backward amplitude at each frequency."""

    forward: list[float]
    """Amplitude in the direction of rotation of the shaft at each frequency."""

    backward: list[float]
    """Amplitude against the direction of rotation of the shaft at each frequency."""


class SpectrumModel(ApiModel):
    """Averaged amplitude spectra of a bearing; all amplitudes are displacements."""

    frequency_hz: list[float]

    time: Time
    """End of the averaged samples."""

    channels: dict[str, SpectrumChannelModel]
    """Spectra by channel: shaft_x, shaft_y, bearing_x and bearing_y."""

    full: dict[Literal["shaft", "bearing"], FullSpectrumModel | None]
    """Full spectra of shaft and bearing; null if a channel of the pair is not usable."""

    lines: dict[str, float | None]
    """Frequencies of 1× ("order1") and of the vortex ("vortex"), Hz; null if unknown."""


OWN_FIELDS = ("duration_s", "speed_rpm", "power_mw", "order1_hz", "vortex_hz")
"""Fields of the answer with one value for each stored spectrum."""

MAX_NUMBERS = 2_000_000
"""Maximum number of amplitudes in one answer, about 20 MB."""

DECIMALS = 6
"""Number of decimals of amplitudes in µm, more than the precision of stored spectra."""


def _place(shown: Sequence[StoredSpectrum], place: PlaceName, n_lines: int) -> PlaceSpectraModel:
    rows = [each.amplitude_um_pk[PLACES[place], :n_lines] for each in shown]
    amplitude = [None if np.isnan(row).any() else np.round(row, DECIMALS).tolist() for row in rows]
    return PlaceSpectraModel(unit="um_pk", amplitude=amplitude)


def _channel(spectrum: CrossSpectrum, place: int) -> SpectrumChannelModel:
    is_usable = spectrum.n_segments[place, place]
    amplitude = spectrum.amplitude_um_pk(place).tolist() if is_usable else None
    return SpectrumChannelModel(unit="um_pk", amplitude=amplitude)


def _full(spectrum: CrossSpectrum, x: int, y: int, sense: int) -> FullSpectrumModel | None:
    if not spectrum.n_segments[x, y]:
        return None
    forward, backward = spectrum.rotating_um_pk(x, y)[::sense]
    return FullSpectrumModel(
        unit="um_pk",
        forward=np.round(forward, DECIMALS).tolist(),
        backward=np.round(backward, DECIMALS).tolist(),
    )


def spectrum_model(assessment: Assessment, rotation_sense: int) -> SpectrumModel:
    """Return the API model of the spectra of a result.

    `rotation_sense` is +1 if the shaft turns from x to y, and -1 if it turns from y to x.
    """
    spectrum, readings = assessment.spectrum, assessment.readings
    return SpectrumModel.of(
        time=assessment.time_ns,
        frequency_hz=spectrum.frequency_hz.tolist(),
        channels={name: _channel(spectrum, place) for name, place in PLACES.items()},
        full={
            "shaft": _full(spectrum, SHAFT_X, SHAFT_Y, rotation_sense),
            "bearing": _full(spectrum, BEARING_X, BEARING_Y, rotation_sense),
        },
        lines={name: marked_hz(readings, name) for name in ("order1", "vortex")},
    )


MAX_SPECTRA = 1000

log = structlog.get_logger()


def spectra_router(context: Context) -> GuardedRouter:
    """Return the router for spectra."""
    router = subject_router("/units/{unit}/bearings", "bearing")

    @router.get(
        "/{bearing}/spectrum", response_model=SpectrumModel, responses=problem_responses(409)
    )
    async def newest_spectra(request: Request, unit: UnitId, bearing: BearingId) -> Response:
        """Return the averaged amplitude spectra of the newest result, all as displacement."""
        sense = machine_of(context.units[unit]).rotation_sense

        async def newest() -> SpectrumModel:
            found = await context.live.assessment(unit, bearing)
            if found is None:
                detail = (
                    f"unit {unit!r} bearing {bearing!r} has no result yet: no segment is complete"
                )
                raise ProblemError(409, "No result yet", detail)
            return await asyncio.to_thread(spectrum_model, found, sense)

        return await context.answers.of(request, lambda: context.live.revision(unit), newest)

    @router.get("/{bearing}/spectra", response_model=SpectraModel)
    async def spectra_over_time(
        request: Request,
        unit: UnitId,
        bearing: BearingId,
        times: TimeRange,
        channel: Annotated[list[PlaceName] | None, several("Channels", ["shaft_x"], 8)] = None,
        max_spectra: Annotated[
            int, at_most(MAX_SPECTRA, "spectra; more are thinned evenly", minimum=2)
        ] = 200,
        max_frequency_hz: Annotated[
            float | None, parameter("Maximum frequency.", 6.0, gt=0.0, allow_inf_nan=False)
        ] = None,
    ) -> Response:
        """List stored averaged amplitude spectra, all as displacement.

        Thinning omits spectra between those returned; it does not average them.
        """
        places = list(dict.fromkeys(channel or PLACES))
        query = SpectraQuery(unit, bearing, *times, max_spectra)

        def read() -> SpectraModel:
            found = context.store.spectra.read(query)
            if found.damaged_ns:
                words, n = "stored spectra are damaged and left out", len(found.damaged_ns)
                log.error(words, unit=unit, bearing=bearing, n=n)
            shown = [one for one in found.spectra if one.resolution == found.spectra[-1].resolution]
            bin_hz, n_lines = shown[-1].resolution if shown else (0.0, 0)
            frequency_hz = bin_hz * np.arange(1, n_lines + 1, dtype=np.float64)
            if max_frequency_hz is not None:
                frequency_hz = frequency_hz[frequency_hz <= max_frequency_hz]
            n_numbers = len(places) * frequency_hz.size
            if len(shown) * n_numbers > MAX_NUMBERS:
                detail = (
                    f"{len(shown)} spectra of {n_numbers} amplitudes are too many; ask for at most"
                    f" {max(2, MAX_NUMBERS // n_numbers)} spectra or fewer channels, or lower"
                    " max_frequency_hz"
                )
                raise ProblemError(422, "Wrong parameter", detail, "max_spectra")
            return SpectraModel.of(
                query,
                found,
                frequency_hz=frequency_hz.tolist(),
                time=[each.time_ns for each in shown],
                operating_state=[STATE_NAMES[each.state] for each in shown],
                level=[LEVEL_NAMES[each.quality.level] for each in shown],
                reason=[each.quality.reason.value for each in shown],
                **{name: [getattr(each, name) for each in shown] for name in OWN_FIELDS},
                channels={place: _place(shown, place, frequency_hz.size) for place in places},
                n_other_resolution=len(found.spectra) - len(shown),
                simulated_until=context.store.films.past_end_ns(unit, bearing),
            )

        revision = partial(context.past_revision, unit, times)
        return await context.answers.of(request, revision, read)

    return router
