"""Sending of operators' commands to the measuring process."""

import asyncio
from abc import ABC, abstractmethod

from core.alarms.alarm import Alarm
from core.alarms.operation import Action, ActionRefusedError
from service.live.alarm_list import LiveAlarms
from service.live.commands import (
    AlarmCommand,
    BaselineAction,
    BaselineCommand,
    BaselineRefusedError,
    CommandFailedError,
    FilmPlace,
    OperatorCommand,
    ReferenceRefusedError,
    TakeReference,
)
from service.store.notes import Note
from service.store.references import SetVectorReference
from service.store.sharing import Answer, CommandState
from service.store.store import Store


class Operators(ABC):
    """Sender of operators' commands to the process that analyses the unit.

    Parameters
    ----------
    store
        Database from which stored alarms and references are read after a command.
    alarms
        Alarms of this process, updated after a command.
    """

    def __init__(self, store: Store, alarms: LiveAlarms) -> None:
        self._store, self._alarms = store, alarms

    @abstractmethod
    async def send(self, unit: str, command: OperatorCommand, actor: str) -> Answer:
        """Send a command; return the answer, which states whether the result is stored.

        Raises
        ------
        CommandFailedError
            If no process answers.
        """

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Apply an operator's action to the alarm with the id `id_`; return the stored alarm.

        Raises
        ------
        LookupError
            If the alarm does not exist.
        ActionRefusedError
            If the action does not fit the state of the alarm.
        CommandFailedError
            If the action was not carried out or not stored.
        """
        answer = await self._carried_out(
            self._alarms.owner(id_), AlarmCommand(id_, action), action.actor
        )
        if answer.state is CommandState.UNKNOWN:
            raise LookupError(answer.words)
        if answer.state is CommandState.REFUSED:
            raise ActionRefusedError(answer.words)
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        return self._alarms.alarm(id_)

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Apply an engineer's action to the baselines of a bearing, and wait until it is stored.

        Raises
        ------
        BaselineRefusedError
            If the action does not fit the state of the baselines.
        CommandFailedError
            If the action was not carried out or not stored.
        """
        command = BaselineCommand(place, action, actor, reason)
        answer = await self._carried_out(place.unit, command, actor)
        if answer.state is CommandState.REFUSED:
            raise BaselineRefusedError(answer.words)

    async def take_reference(self, command: TakeReference) -> SetVectorReference:
        """Store the newest 1× vectors of a bearing as reference, and return the reference.

        Raises
        ------
        ReferenceRefusedError
            If there is no current result, or its vectors cannot be used as a reference.
        CommandFailedError
            If the command was not carried out or not stored.
        """
        answer = await self._carried_out(command.unit, command, command.actor)
        if answer.state is CommandState.REFUSED:
            raise ReferenceRefusedError(answer.words)
        history = self._store.order1_references.history
        return (await asyncio.to_thread(history, command.unit, command.bearing))[0]

    async def add_note(self, note: Note) -> None:
        """Store an operator's note; raise `CommandFailedError` if it was not stored."""
        await self._carried_out(note.unit, note, note.author)

    async def _carried_out(self, unit: str, command: OperatorCommand, actor: str) -> Answer:
        answer = await self.send(unit, command, actor)
        if answer.state in FAILED:
            words = answer.words or "not stored yet; check its result before you repeat it"
            raise CommandFailedError(FAILED[answer.state], f"unit {unit}: {words}")
        return answer


FAILED = {
    CommandState.WITHDRAWN: "Action not applied",
    CommandState.INTERRUPTED: "Not stored",
    CommandState.TAKEN: "Not stored yet",
    CommandState.WAITING: "Not stored yet",
}
"""Title of the problem for each state in which a command is not known to be stored."""
