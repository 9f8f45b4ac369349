"""`UnitState`: state of a unit, published in the database by the process that analyses the unit."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import ConfigDict, TypeAdapter, ValidationError

from core.alarms.alarm import Alarm
from core.change.film_judge import FilmFinding
from core.change.film_reading import FilmReading
from core.condition.cells import BearingCondition
from core.machine.unit import Estimator
from core.monitor.assessment import AveragingWindow
from core.quality import Quality, Reading
from core.spectra.runout import RunoutVerdict
from core.spectra.segments import Evidence
from core.spectra.speed import SpeedSource
from core.uncertainty import Budget
from service.live.live_view import UnitStatus

MAX_BYTES = 16_000_000
"""Maximum size in bytes of a decompressed document, many times that of the largest unit."""


class UnreadableStateError(Exception):
    """A published state of a unit is damaged, or from another version of the program."""


@dataclass(frozen=True)
class BearingState:
    """Newest result of a bearing: an `Assessment` without spectrum, orbit and recent values."""

    time_ns: int
    window: AveragingWindow
    speed_source: SpeedSource
    quality: Quality
    readings: Mapping[str, Reading]
    budgets: Mapping[str, Budget]
    estimators: Mapping[str, Estimator | None]
    runout: Mapping[str, RunoutVerdict]
    clipped_share: Mapping[str, float]
    evidence: Evidence
    condition: BearingCondition | None


@dataclass(frozen=True)
class FilmState:
    """Newest reading of an oil film, and its finding in each direction (x, y)."""

    reading: FilmReading
    findings: tuple[FilmFinding, FilmFinding]


@dataclass(frozen=True)
class UnitState:
    """State of a unit that changes with each result; `bearings` and `films` are by bearing id.

    Parameters
    ----------
    alarms
        All alarms of the unit.
    judged, chattering
        Ids of the alarms whose condition is now known, and of the chattering alarms.
    baselines
        Baseline version in force, by bearing id.
    """

    bearings: Mapping[str, BearingState]
    alarms: tuple[Alarm, ...]
    judged: frozenset[str]
    chattering: frozenset[str]
    films: Mapping[str, FilmState]
    baselines: Mapping[str, int]


@dataclass(frozen=True)
class UnitSigns:
    """State of a unit that changes continuously: link, and age of samples and results.

    Parameters
    ----------
    data_age_s
        Age of the newest samples in seconds; None before the first.
    result_ages_s
        Age of the newest result in seconds, by bearing id.
    n_unstored
        Number of findings that the process could not store.
    store_error
        Present error of the database in the process that analyses the unit, or None.
    said_s
        Monotonic time of the process at which the state was published; None in states of older
        versions.
    """

    status: UnitStatus
    data_age_s: float | None
    result_ages_s: Mapping[str, float]
    n_unstored: int = 0
    store_error: str | None = None
    said_s: float | None = None


# wrapped in a tuple, so that the NaN setting applies to all nested values
_WITH_NAN = ConfigDict(ser_json_inf_nan="constants")
_STATE = TypeAdapter(tuple[UnitState], config=_WITH_NAN)
_SIGNS = TypeAdapter(tuple[UnitSigns], config=_WITH_NAN)


def packed_state(state: UnitState) -> bytes:
    """Return the state as a zlib-compressed JSON document."""
    return zlib.compress(_STATE.dump_json((state,)), level=1)


def unpacked_state(document: bytes) -> UnitState:
    """Return the state from a document of `packed_state`.

    Raises
    ------
    UnreadableStateError
        If the document is damaged, or from another version of the program.
    """
    try:
        unpacker = zlib.decompressobj()
        content = unpacker.decompress(document, MAX_BYTES)
        if unpacker.unconsumed_tail or not unpacker.eof:
            raise UnreadableStateError("the published state of a unit is truncated or too long")
        return _STATE.validate_json(content)[0]
    except (zlib.error, ValidationError) as error:
        raise UnreadableStateError(f"state of a unit cannot be read: {error}") from error


def written_signs(signs: UnitSigns) -> str:
    """Return the continuously changing state as a JSON document."""
    return _SIGNS.dump_json((signs,)).decode()


def read_signs(document: str) -> UnitSigns:
    """Return the state from a document of `written_signs`; raises `UnreadableStateError`."""
    try:
        return _SIGNS.validate_json(document)[0]
    except ValidationError as error:
        raise UnreadableStateError(f"status of a unit cannot be read: {error}") from error
