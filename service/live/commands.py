"""Commands of operators and engineers to the measuring process, and their errors."""

from dataclasses import dataclass
from typing import Any, TypeAlias

from pydantic import TypeAdapter, ValidationError

from core.alarms import operation
from core.alarms.operation import Action
from core.machine.unit import Estimator
from service.store.baselines import BaselineEntry, BaselineStep, StoredStep, Versions


@dataclass(frozen=True)
class FilmPlace:
    """Film of a bearing, with the estimator of its stiffness."""

    unit: str
    bearing: str
    estimator: Estimator


class BaselineRefusedError(ValueError):
    """An action does not fit the state of the baselines; the message states why."""


@dataclass(frozen=True)
class Accept:
    """Put a baseline version in force."""

    version: int


@dataclass(frozen=True)
class Reject:
    """Withdraw a baseline version; it is never put in force automatically again."""

    version: int


@dataclass(frozen=True)
class Freeze:
    """Stop learning of baselines of a bearing."""


@dataclass(frozen=True)
class Thaw:
    """Resume learning of baselines of a bearing."""


@dataclass(frozen=True)
class Renew:
    """Learn a new baseline after a machine event such as an overhaul, without older readings."""

    from_ns: int


BaselineAction: TypeAlias = Accept | Reject | Freeze | Thaw | Renew


def baseline_step(
    action: BaselineAction,
    place: FilmPlace,
    versions: Versions,
    entries: list[BaselineEntry],
    actor: str,
    reason: str,
    now_ns: int,
) -> StoredStep:
    """Return the baseline step to store for an action.

    Parameters
    ----------
    entries
        All baselines of the bearing.

    Raises
    ------
    BaselineRefusedError
        If the action does not fit the state of the baselines.
    """
    version: int | None = versions.in_force
    from_ns: int | None = None
    match action:
        case Accept():
            step, version = BaselineStep.ACCEPTED, action.version
            _require_acceptable(action.version, place, versions, entries)
        case Reject():
            is_in_force, version = action.version == version, action.version
            step = BaselineStep.WITHDRAWN if is_in_force else BaselineStep.REJECTED
            _entry(action.version, entries)
            if version in versions.rejected:
                raise BaselineRefusedError(f"version {version} is already rejected")
        case Freeze():
            step = BaselineStep.FROZEN
            if versions.is_frozen:
                raise BaselineRefusedError(f"{place.bearing} is already frozen")
            if version is None:
                raise BaselineRefusedError(f"{place.bearing} has no baseline in force")
        case Thaw():
            step = BaselineStep.THAWED
            if not versions.is_frozen:
                raise BaselineRefusedError(f"{place.bearing} is not frozen")
        case Renew():
            step, version, from_ns = BaselineStep.RENEWED, None, action.from_ns
            if from_ns > now_ns:
                raise BaselineRefusedError("a machine event cannot lie in the future")
            if versions.renewed_ns is not None and from_ns < versions.renewed_ns:
                raise BaselineRefusedError("there is already a later machine event")
    return StoredStep(place.unit, place.bearing, version, step, now_ns, actor, reason, from_ns)


def _entry(version: int, entries: list[BaselineEntry]) -> BaselineEntry:
    for entry in entries:
        if entry.version == version:
            return entry
    raise BaselineRefusedError(f"there is no version {version}")


def _require_acceptable(
    version: int, place: FilmPlace, versions: Versions, entries: list[BaselineEntry]
) -> None:
    entry = _entry(version, entries)
    if version == versions.in_force:
        raise BaselineRefusedError(f"version {version} is already in force")
    if entry.estimator is not place.estimator:
        raise BaselineRefusedError(
            f"version {version} was learned with estimator {entry.estimator};"
            f" the film is watched with {place.estimator}"
        )
    if versions.renewed_ns is not None and entry.learned_from_ns < versions.renewed_ns:
        raise BaselineRefusedError(f"version {version} is older than the last machine event")


class UnreadableCommandError(Exception):
    """The command cannot be read by this version of the program."""


@dataclass(frozen=True)
class AlarmCommand:
    """Action on an alarm."""

    alarm: str
    action: Action


@dataclass(frozen=True)
class BaselineCommand:
    """Action on the baselines of a bearing."""

    place: FilmPlace
    action: BaselineAction
    actor: str
    reason: str


@dataclass(frozen=True)
class ReferenceCommand:
    """Notice that a 1× reference of a unit was stored."""

    unit: str


OperatorCommand: TypeAlias = AlarmCommand | BaselineCommand | ReferenceCommand

_ALARM_ACTIONS = {
    kind.__name__: TypeAdapter[Any](tuple[str, kind])  # type: ignore[valid-type]
    for kind in (
        *(operation.Acknowledge, operation.Shelve, operation.Unshelve),
        *(operation.TakeOutOfService, operation.ReturnToService),
        *(operation.Reset, operation.Comment),
    )
}
_BASELINE_ACTIONS = {
    kind.__name__: TypeAdapter[Any](tuple[FilmPlace, kind, str, str])  # type: ignore[valid-type]
    for kind in (Accept, Reject, Freeze, Thaw, Renew)
}
_REFERENCE = TypeAdapter(ReferenceCommand)


def encoded(command: OperatorCommand) -> tuple[str, str]:
    """Return the kind and the JSON document of a command."""
    if isinstance(command, ReferenceCommand):
        return ReferenceCommand.__name__, _REFERENCE.dump_json(command).decode()
    kind = type(command.action).__name__
    if isinstance(command, AlarmCommand):
        return kind, _ALARM_ACTIONS[kind].dump_json((command.alarm, command.action)).decode()
    whole = (command.place, command.action, command.actor, command.reason)
    return kind, _BASELINE_ACTIONS[kind].dump_json(whole).decode()


def decoded(kind: str, document: str) -> OperatorCommand:
    """Return the command of a kind and a JSON document.

    Raises
    ------
    UnreadableCommandError
        If the document is from another version of the program, or damaged.
    """
    try:
        if kind in _ALARM_ACTIONS:
            return AlarmCommand(*_ALARM_ACTIONS[kind].validate_json(document))
        if kind in _BASELINE_ACTIONS:
            return BaselineCommand(*_BASELINE_ACTIONS[kind].validate_json(document))
        if kind == ReferenceCommand.__name__:
            return _REFERENCE.validate_json(document)
    except ValidationError as error:
        raise UnreadableCommandError(f"command {kind} cannot be read: {error}") from error
    raise UnreadableCommandError(f"unknown command {kind!r}")


class NotAvailableError(Exception):
    """The data exist only in the process that analyses the unit; the message names the data."""


class CommandFailedError(Exception):
    """The command was not carried out or not stored; the message states which."""

    def __init__(self, title: str, detail: str) -> None:
        super().__init__(detail)
        self.title = title
