"""What the API answers about spectra over time, by column."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.film_models import OperatingStateName
from service.api.models import ApiModel, LevelName, Time
from service.api.series_models import PlaceName


class PlaceSpectraModel(ApiModel):
    """Spectra of one channel over time."""

    unit: Literal["um_pk"]
    """Displacement, zero to peak."""

    amplitude: list[list[float] | None]
    """For each time a value for each frequency; null where the channel was not usable."""


class SpectraModel(ApiModel):
    """Averaged amplitude spectra of a bearing over time, oldest first."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    start: Time
    """First time asked for."""

    end: Time
    """Time up to which was asked."""

    frequency_hz: Annotated[list[float], Field(examples=[[0.073, 0.146, 0.22]])]
    """Frequencies of the lines of all these spectra."""

    time: list[float]
    """Seconds since 1970 UTC: end of the samples of each spectrum."""

    duration_s: list[float]
    """Length of the samples that each is an average of."""

    speed_rpm: list[float | None]
    """Running speed; null where it was not known."""

    power_mw: list[float | None]
    """Active power, likewise."""

    operating_state: list[OperatingStateName]
    """What the unit did."""

    level: list[LevelName]
    """Worst quality of the 1× amplitudes of that time."""

    reason: list[str]
    """Why it is not good; "ok" if it is."""

    order1_hz: list[float | None]
    """Where 1× was read."""

    vortex_hz: list[float | None]
    """Where the vortex was read."""

    channels: dict[PlaceName, PlaceSpectraModel]
    """The channels asked for."""

    n_found: int
    """Spectra that are kept of this range; of more than `max_spectra`, evenly chosen ones are
    given."""

    n_other_resolution: int
    """Left out, because their lines lie elsewhere than those of the newest one: the analysis was
    set up otherwise then."""

    damaged: list[Time]
    """Left out, because they are damaged on the disk."""

    first: Time | None
    """Time of the oldest spectrum that is kept of this bearing; null if there is none."""

    simulated_until: Time | None
    """Until when readings of this bearing are simulated, which have no spectra; null where all are
    measured."""
