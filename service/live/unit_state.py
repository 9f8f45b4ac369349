"""`UnitState`: what is known of a unit now, as the process that analyses it writes it down."""

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
"""Of a document, unpacked: many times what the largest unit needs."""


class UnreadableStateError(Exception):
    """What is written down of a unit cannot be read: another version's, or damaged."""


@dataclass(frozen=True)
class BearingState:
    """The newest result of a bearing, without the arrays that stay where it was found."""

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
    """What was said of a film last."""

    reading: FilmReading
    findings: tuple[FilmFinding, FilmFinding]


@dataclass(frozen=True)
class UnitState:
    """What changes with each result: newest results, alarms and films, by bearing.

    Parameters
    ----------
    alarms
        All of the unit, whatever their state.
    judged, chattering
        Identifiers of alarms whose watched quantity is known now, and of those that come and go.
    baselines
        Version in force, by bearing that has one.
    """

    bearings: Mapping[str, BearingState]
    alarms: tuple[Alarm, ...]
    judged: frozenset[str]
    chattering: frozenset[str]
    films: Mapping[str, FilmState]
    baselines: Mapping[str, int]


@dataclass(frozen=True)
class UnitSigns:
    """What changes all the time: how samples arrive, and how old everything is.

    Parameters
    ----------
    data_age_s, result_ages_s
        Since the newest samples, and since the newest result of each bearing, at the moment of
        writing; by a clock that never goes back.
    n_unstored
        Findings that the process has given up.
    store_error
        Why it cannot store just now.
    said_s
        When this was so, by the steady clock of the process that says it; None from those that do
        not say it yet.
    """

    status: UnitStatus
    data_age_s: float | None
    result_ages_s: Mapping[str, float]
    n_unstored: int = 0
    store_error: str | None = None
    said_s: float | None = None


# within a tuple, so that NaN is written as such wherever it stands
_WITH_NAN = ConfigDict(ser_json_inf_nan="constants")
_STATE = TypeAdapter(tuple[UnitState], config=_WITH_NAN)
_SIGNS = TypeAdapter(tuple[UnitSigns], config=_WITH_NAN)


def packed_state(state: UnitState) -> bytes:
    """Write a state; `unpacked_state` gives an equal one."""
    return zlib.compress(_STATE.dump_json((state,)), level=1)


def unpacked_state(document: bytes) -> UnitState:
    """Read a state.

    Raises
    ------
    UnreadableStateError
        If it is none, or one of another version of this program.
    """
    try:
        unpacker = zlib.decompressobj()
        content = unpacker.decompress(document, MAX_BYTES)
        if unpacker.unconsumed_tail or not unpacker.eof:
            raise UnreadableStateError("the state of a unit is cut off, or too long")
        return _STATE.validate_json(content)[0]
    except (zlib.error, ValidationError) as error:
        raise UnreadableStateError(f"the state of a unit cannot be read: {error}") from error


def written_signs(signs: UnitSigns) -> str:
    """Write signs of life as text; `read_signs` gives equal ones."""
    return _SIGNS.dump_json((signs,)).decode()


def read_signs(document: str) -> UnitSigns:
    """Read signs of life; raises as `unpacked_state` does."""
    try:
        return _SIGNS.validate_json(document)[0]
    except ValidationError as error:
        raise UnreadableStateError(f"how a unit does cannot be read: {error}") from error
