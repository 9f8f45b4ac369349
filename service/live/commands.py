"""What operators and engineers may ask of the measuring side, and the answers."""

from dataclasses import dataclass
from typing import Any, TypeAlias

from pydantic import TypeAdapter, ValidationError

from core.alarms import operation
from core.alarms.operation import Action
from core.machine.unit import Estimator
from service.store.baselines import BaselineEntry, BaselineStep, StoredStep, Versions


@dataclass(frozen=True)
class FilmPlace:
    """One bearing of one unit, by one estimator."""

    unit: str
    bearing: str
    estimator: Estimator


class BaselineRefusedError(ValueError):
    """An action does not fit the baselines as they are now; the message says why."""


@dataclass(frozen=True)
class Accept:
    """Compare the bearing with a version from now on."""

    version: int


@dataclass(frozen=True)
class Reject:
    """Compare it with that version no longer, and never by itself again."""

    version: int


@dataclass(frozen=True)
class Freeze:
    """Learn no further."""


@dataclass(frozen=True)
class Thaw:
    """Learn again."""


@dataclass(frozen=True)
class Renew:
    """Begin again after a machine event, as an overhaul: older readings count no longer."""

    from_ns: int


BaselineAction: TypeAlias = Accept | Reject | Freeze | Thaw | Renew


def step_of(
    action: BaselineAction,
    place: FilmPlace,
    versions: Versions,
    entries: list[BaselineEntry],
    actor: str,
    reason: str,
    now_ns: int,
) -> StoredStep:
    """What is to be written if somebody does this now.

    Parameters
    ----------
    entries
        Every baseline of the bearing.

    Raises
    ------
    BaselineRefusedError
        If it does not fit the baselines as they are.
    """

    def done(step: BaselineStep, version: int | None, from_ns: int | None = None) -> StoredStep:
        return StoredStep(place.unit, place.bearing, version, step, now_ns, actor, reason, from_ns)

    match action:
        case Accept(version):
            _require_acceptable(version, place, versions, entries)
            return done(BaselineStep.ACCEPTED, version)
        case Reject(version):
            _require_version(version, entries)
            if version in versions.rejected:
                raise BaselineRefusedError(f"version {version} is rejected already")
            is_used = version == versions.in_force
            return done(BaselineStep.WITHDRAWN if is_used else BaselineStep.REJECTED, version)
        case Freeze():
            if versions.in_force is None or versions.is_frozen:
                why = "is frozen already" if versions.is_frozen else "has no baseline in force"
                raise BaselineRefusedError(f"{place.bearing} {why}")
            return done(BaselineStep.FROZEN, versions.in_force)
        case Thaw():
            if not versions.is_frozen:
                raise BaselineRefusedError(f"{place.bearing} is not frozen")
            return done(BaselineStep.THAWED, versions.in_force)
        case Renew(from_ns):
            if from_ns > now_ns:
                raise BaselineRefusedError("a machine event cannot lie in the future")
            if versions.renewed_ns is not None and from_ns < versions.renewed_ns:
                raise BaselineRefusedError("there has been a later machine event already")
            return done(BaselineStep.RENEWED, None, from_ns)


def _require_version(version: int, entries: list[BaselineEntry]) -> BaselineEntry:
    for entry in entries:
        if entry.version == version:
            return entry
    raise BaselineRefusedError(f"there is no version {version}")


def _require_acceptable(
    version: int, place: FilmPlace, versions: Versions, entries: list[BaselineEntry]
) -> None:
    entry = _require_version(version, entries)
    if version == versions.in_force:
        raise BaselineRefusedError(f"version {version} is in force already")
    if entry.estimator is not place.estimator:
        raise BaselineRefusedError(
            f"version {version} was learned of {entry.estimator}, watched is {place.estimator}"
        )
    if versions.renewed_ns is not None and entry.learned_from_ns < versions.renewed_ns:
        raise BaselineRefusedError(f"version {version} is of before the last machine event")


class UnreadableCommandError(Exception):
    """A command that this version of the program does not know."""


@dataclass(frozen=True)
class OnAlarm:
    """Something that is done to an alarm."""

    alarm: str
    action: Action


@dataclass(frozen=True)
class OnBaselines:
    """Something that is done to the baselines of a bearing."""

    place: FilmPlace
    action: BaselineAction
    actor: str
    reason: str


@dataclass(frozen=True)
class NewReference:
    """A reference of 1× was stored for a bearing of a unit."""

    unit: str


Task: TypeAlias = OnAlarm | OnBaselines | NewReference

_ALARM_ACTIONS: dict[str, type[Any]] = {
    kind.__name__: kind
    for kind in (
        *(operation.Acknowledge, operation.Shelve, operation.Unshelve),
        *(operation.TakeOutOfService, operation.ReturnToService),
        *(operation.Reset, operation.Comment),
    )
}
_BASELINE_ACTIONS: dict[str, type[Any]] = {
    kind.__name__: kind for kind in (Accept, Reject, Freeze, Thaw, Renew)
}
_REFERENCE = NewReference.__name__
_ON_ALARM = {k: TypeAdapter(tuple[str, c]) for k, c in _ALARM_ACTIONS.items()}  # type: ignore[valid-type]
_ON_BASELINES = {
    k: TypeAdapter(tuple[FilmPlace, c, str, str])  # type: ignore[valid-type]
    for k, c in _BASELINE_ACTIONS.items()
}


def written(task: Task) -> tuple[str, str]:
    """Kind and document of a task; `read` gives an equal one."""
    if isinstance(task, OnAlarm):
        kind = type(task.action).__name__
        return kind, _ON_ALARM[kind].dump_json((task.alarm, task.action)).decode()
    if isinstance(task, OnBaselines):
        kind = type(task.action).__name__
        whole = (task.place, task.action, task.actor, task.reason)
        return kind, _ON_BASELINES[kind].dump_json(whole).decode()
    return _REFERENCE, TypeAdapter(NewReference).dump_json(task).decode()


def read(kind: str, document: str) -> Task:
    """Read a task.

    Raises
    ------
    UnreadableCommandError
        If it is of another version, or damaged.
    """
    try:
        if kind in _ON_ALARM:
            return OnAlarm(*_ON_ALARM[kind].validate_json(document))
        if kind in _ON_BASELINES:
            return OnBaselines(*_ON_BASELINES[kind].validate_json(document))
        if kind == _REFERENCE:
            return TypeAdapter(NewReference).validate_json(document)
    except ValidationError as error:
        raise UnreadableCommandError(f"command {kind} cannot be read: {error}") from error
    raise UnreadableCommandError(f"this padwatch knows no command {kind!r}")


class NotHereError(Exception):
    """It exists only in the process that analyses; the message says so."""


class NotCarriedOutError(Exception):
    """What somebody asked for is not done, or not on the disk; the message says which."""

    def __init__(self, title: str, detail: str) -> None:
        super().__init__(detail)
        self.title = title
