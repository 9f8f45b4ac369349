"""Commands of operators from the serving to the measuring process, and their sending."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, get_args

from pydantic import TypeAdapter, ValidationError

from core.alarms.alarm import Alarm
from core.alarms.operation import Action, ActionRefusedError
from core.machine.unit import Estimator
from service.live.alarm_list import LiveAlarms, UnknownAlarmError
from service.live.snapshot import OWN_VERSION, UnreadableError, content_of
from service.store.notes import Note
from service.store.references import SetVectorReference
from service.store.sharing import Answer, CommandState
from service.store.store import Store


@dataclass(frozen=True)
class FilmPlace:
    """Identification of a bearing's oil film: unit, bearing id, and estimator of the stiffness."""

    unit: str
    bearing: str
    estimator: Estimator


class BaselineRefusedError(ValueError):
    """Error raised if the state of the baselines does not allow an action."""


@dataclass(frozen=True)
class Accept:
    """Action that puts a version of a baseline in force, to compare readings with it."""

    version: int


@dataclass(frozen=True)
class Reject:
    """Action that rejects a version of a baseline, also the version in force."""

    version: int


@dataclass(frozen=True)
class Freeze:
    """Action that stops the learning of new baselines of a bearing."""


@dataclass(frozen=True)
class Thaw:
    """Action that resumes the learning of new baselines of a bearing."""


@dataclass(frozen=True)
class Renew:
    """Action that starts learning anew after a machine event at `from_ns`, ns since 1970 UTC."""

    from_ns: int


BaselineAction: TypeAlias = Accept | Reject | Freeze | Thaw | Renew


@dataclass(frozen=True)
class AlarmCommand:
    """Command to apply an operator's action to an alarm, given by its id."""

    alarm: str
    action: Action


@dataclass(frozen=True)
class BaselineCommand:
    """Command to apply an engineer's action to the baselines of a bearing, with author and reason.

    `actor` is the name that the audit trail and the history of baselines show.
    """

    place: FilmPlace
    action: BaselineAction
    actor: str
    reason: str


@dataclass(frozen=True)
class TakeReference:
    """Command to store the newest 1× vectors of a bearing as reference for its operating state."""

    unit: str
    bearing: str
    actor: str
    note: str


OperatorCommand: TypeAlias = AlarmCommand | BaselineCommand | TakeReference | Note

_KINDS: dict[str, tuple[type[OperatorCommand], TypeAdapter[Any]]] = {
    **{
        kind.__name__: (AlarmCommand, TypeAdapter(tuple[str, kind]))  # type: ignore[valid-type]
        for kind in get_args(Action)
    },
    **{
        kind.__name__: (BaselineCommand, TypeAdapter(tuple[FilmPlace, kind, str, str]))  # type: ignore[valid-type]
        for kind in get_args(BaselineAction)
    },
    TakeReference.__name__: (TakeReference, TypeAdapter(tuple[str, str, str, str])),
    Note.__name__: (Note, TypeAdapter(tuple[str, str | None, int, str, str])),
}
"""Class of the command, and adapter of its fields in their order, by kind."""


BASELINE_ACTIONS = frozenset(kind.__name__ for kind in get_args(BaselineAction))
"""Kinds of commands with an action on baselines."""


def encoded(command: OperatorCommand) -> tuple[str, str]:
    """Return the kind of a command (the name of its class or action) and its document.

    The document is the version of the program, a line feed, and the fields of the command as JSON.
    """
    kind = type(getattr(command, "action", command)).__name__
    fields = _KINDS[kind][1].dump_json(tuple(vars(command).values())).decode()
    return kind, OWN_VERSION.decode() + fields


def decoded(kind: str, document: str) -> OperatorCommand:
    """Decode a command from the kind and the document that `encoded` returned.

    Raises `UnreadableError` if the document is damaged, or from another version of the program.
    """
    content = content_of(document.encode(), "command")
    if kind not in _KINDS:
        raise UnreadableError(f"unknown command {kind}; update all processes to one version")
    made, adapter = _KINDS[kind]
    try:
        return made(*adapter.validate_json(content))
    except ValidationError as error:
        raise UnreadableError(f"command {kind} cannot be read: {error}") from error


class NotAvailableError(Exception):
    """Error raised if requested data exist only in the process that analyses the unit."""


class ReferenceRefusedError(Exception):
    """Error raised if gaps or vectors cannot be used as a reference; the message states why."""


class CommandFailedError(Exception):
    """Error raised if a command was not carried out or not stored; `title` states which."""

    def __init__(self, title: str, detail: str) -> None:
        super().__init__(detail)
        self.title = title


Send = Callable[[str, OperatorCommand, str], Awaitable[Answer]]
"""Coroutine function that sends a command about a unit to the process that analyses the unit. Its
arguments are the unit, the command and the user. It returns the answer, which states whether the
result is stored, and raises `CommandFailedError` if no process answers."""


class Operators:
    """Sender of operators' commands to the process that analyses the unit, by the function `send`.

    Stored alarms and references are read from `store` after a command, and `alarms` are updated.
    """

    def __init__(self, send: Send, store: Store, alarms: LiveAlarms) -> None:
        self._send, self._store, self._alarms = send, store, alarms

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Apply an operator's action to the alarm with the id `id_`; return the stored alarm.

        Raises
        ------
        UnknownAlarmError
            If the alarm does not exist.
        ActionRefusedError
            If the action does not fit the state of the alarm.
        CommandFailedError
            If the action was not carried out or not stored.
        """
        command = AlarmCommand(id_, action)
        await self._execute(self._alarms.owner(id_), command, action.actor, ActionRefusedError)
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        return self._alarms.alarm(id_)

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Apply an engineer's action to the baselines of a bearing, and wait until it is stored.

        `actor` is the name of the engineer, `reason` the reason that the engineer gave.

        Raises
        ------
        BaselineRefusedError
            If the action does not fit the state of the baselines.
        CommandFailedError
            If the action was not carried out or not stored.
        """
        command = BaselineCommand(place, action, actor, reason)
        await self._execute(place.unit, command, actor, BaselineRefusedError)

    async def take_reference(self, command: TakeReference) -> SetVectorReference:
        """Store the newest 1× vectors of a bearing as reference, and return the reference.

        Raises
        ------
        ReferenceRefusedError
            If there is no current result, or its vectors cannot be used as a reference.
        CommandFailedError
            If the command was not carried out or not stored.
        """
        await self._execute(command.unit, command, command.actor, ReferenceRefusedError)
        history = self._store.order1_references.history
        return (await asyncio.to_thread(history, command.unit, command.bearing))[0]

    async def add_note(self, note: Note) -> None:
        """Store an operator's note; raise `CommandFailedError` if it was not stored."""
        await self._execute(note.unit, note, note.author)

    async def _execute(
        self,
        unit: str,
        command: OperatorCommand,
        actor: str,
        refusal: type[Exception] | None = None,
    ) -> None:
        """Send a command, and raise an error if it failed: `refusal` if the command is refused."""
        answer = await self._send(unit, command, actor)
        if answer.state is CommandState.UNKNOWN:
            raise UnknownAlarmError(answer.words)
        if answer.state is CommandState.REFUSED and refusal is not None:
            raise refusal(answer.words)
        if answer.state in FAILED:
            words = answer.words or "not stored yet; check its result before you repeat it"
            raise CommandFailedError(FAILED[answer.state], f"unit {unit}: {words}")


FAILED = {
    CommandState.REFUSED: "Action not applied",
    CommandState.WITHDRAWN: "Action not applied",
    CommandState.INTERRUPTED: "Not stored",
    CommandState.TAKEN: "Not stored yet",
    CommandState.WAITING: "Not stored yet",
}
"""Title of the problem for each state in which a command is not known to be stored."""
