"""What the API answers about the plant, its units and the service itself."""

from typing import Literal

from service.api.alarm_models import AlarmCountModel
from service.api.film_models import FilmBriefModel
from service.api.models import ApiModel, LatestModel, Time


class DeviceClockModel(ApiModel):
    """How the device's clock stands against the host's."""

    offset_s: float | None
    """How far the device's time stamps are ahead of the host's clock; null if it does not stamp."""

    drift_ppm: float | None
    """How much faster than nominal the device samples, by the host's clock, in parts per million;
    null during the first minute, and of a device that samples when it is asked."""

    drift_uncertainty_ppm: float | None
    """Standard uncertainty of the drift."""

    n_stamp_faults: int
    """Blocks whose own time stamp did not fit the sample index and was not used."""

    stamp_fault: Literal["stamp_regressed", "stamp_repeated", "stamp_jumped"] | None
    """What was wrong with the newest stamp."""


class SourceModel(ApiModel):
    """How the samples of a unit arrive, and where every one of them went."""

    state: Literal["connecting", "connected", "not_connected", "ended"]
    """Whether samples arrive; only a recording ends."""

    reason: str | None
    """Why not."""

    since: Time | None
    """Since when it has been so."""

    data_age_s: float | None
    """Seconds since the device had the newest sample that is here."""

    last_sample_time: Time | None
    """Time of that sample by the device's clock."""

    n_offered: int
    """Samples per channel the device counted: stored + flagged + gap + rejected."""

    n_stored: int
    """Taken, all channels good."""

    n_flagged: int
    """Taken, some channel not good."""

    n_gap: int
    """Never arrived."""

    n_repeated: int
    """Arrived again and were dropped."""

    n_restarts: int
    """How often the device began to count anew."""

    rejected: dict[str, int]
    """Arrived and were refused, by reason."""

    clock: DeviceClockModel | None
    """The device's clock, where it can be compared with the host's."""


class UnitModel(ApiModel):
    """A unit and how its samples arrive."""

    id: str
    """Stable identifier."""

    name: str
    """As people call it."""

    rated_speed_rpm: float
    """Rated running speed."""

    bearing_ids: list[str]
    """Its guide bearings."""

    source: SourceModel
    """How its samples arrive."""


class UnitOverviewModel(ApiModel):
    """A unit with all its bearings."""

    id: str
    """Stable identifier."""

    name: str
    """As people call it."""

    rated_speed_rpm: float
    """Rated running speed."""

    source: SourceModel
    """How its samples arrive."""

    bearings: list[LatestModel]
    """Its guide bearings now."""

    films: list[FilmBriefModel]
    """Their films, in the same order."""


class PlantModel(ApiModel):
    """The plant."""

    name: str
    """As people call it."""

    origin: Literal["live", "replay"]
    """Whether this happens now or is played from a recording; also in the header Padwatch-Origin of
    every answer."""


class StoreModel(ApiModel):
    """Whether results reach the disk."""

    error: str | None
    """Why they do not."""

    n_unstored: int
    """Results that are not in the database: given up as it did not answer for too long, or refused
    by it and parked."""


class CapturesModel(ApiModel):
    """Whether the samples around alarms reach the disk."""

    error: str | None
    """Why those of the last alarm did not."""

    n_running: int
    """Recordings that are being written."""

    n_written: int
    """Recordings finished since the service started."""


class EvidenceStatusModel(ApiModel):
    """Whether evidence of alarms reaches the disk."""

    error: str | None
    """Why the newest attempt to write it failed."""

    n_waiting: int
    """Occurrences of alarms whose evidence is still to be written."""

    n_written: int
    """Written since the service started."""

    n_lost: int
    """Given up since then, because too many waited."""


class OverviewModel(ApiModel):
    """Everything that a control room wants to see at a glance."""

    plant: PlantModel
    """The plant."""

    time: Time
    """Now."""

    refresh_s: float
    """Seconds from one result to the next."""

    store: StoreModel
    """Whether results reach the disk."""

    alarms: AlarmCountModel
    """How many alarms there are."""

    captures: CapturesModel
    """Whether the samples around them reach the disk."""

    evidence: EvidenceStatusModel | None
    """Whether their evidence does; null where none is kept."""

    units: list[UnitOverviewModel]
    """All units."""


class QuantityModel(ApiModel):
    """A quantity that trends can be asked for."""

    name: str
    """As in readings and trends."""

    unit: str
    """Unit and detector."""

    label: str
    """What it is, in words."""


class HealthModel(ApiModel):
    """Whether the service can do its work."""

    status: Literal["ok", "not ready"]
    """In a word."""

    checks: dict[str, str]
    """Each check in a sentence."""
