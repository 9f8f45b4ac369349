"""Commands as documents: what is done to an alarm, to baselines, or by a new reference."""

from dataclasses import dataclass
from typing import Any, TypeAlias

from pydantic import TypeAdapter, ValidationError

from core.alarms import operation
from core.alarms.operation import Action
from service.live import film_actions as actions
from service.live.film_actions import Action as BaselineAction
from service.live.film_actions import FilmPlace


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
    kind.__name__: kind
    for kind in (actions.Accept, actions.Reject, actions.Freeze, actions.Thaw, actions.Renew)
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
