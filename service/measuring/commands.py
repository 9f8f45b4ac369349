"""Operators' commands, executed in the measuring process."""

import asyncio

from core.alarms.alarm import Alarm
from core.alarms.judgements import VectorReference
from core.alarms.operation import Action
from service.live.commands import BaselineAction, CommandFailedError, FilmPlace
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.recorder import NotStoredError, Recorder
from service.store.port import StoreError

STORED_WITHIN_S = 10.0
"""Maximum wait until the result of an action is on the disk, s."""

ANSWERS_WITHIN_S = 10.0
"""Maximum wait for the empty transaction that checks the store before an action, s."""


class LocalCommands:
    """Operators' commands, applied to the alarms and films of this process."""

    def __init__(self, alarms: AlarmEngine, films: FilmMonitor, recorder: Recorder) -> None:
        self._alarms, self._films, self._recorder = alarms, films, recorder

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Apply an operator's action to an alarm; return the alarm after it is on the disk.

        The action is refused while the store fails, since it must be in the audit trail.
        """
        await self._require_store(self._alarms.alarm(id_))
        alarm = self._alarms.operate(id_, action)
        try:
            async with asyncio.timeout(STORED_WITHIN_S):
                await self._recorder.stored()
        except TimeoutError as error:
            raise CommandFailedError(
                "Not stored yet",
                f"alarm {id_} is {alarm.state.value}, but the store does not respond:"
                " a restart now would undo the action; storing is retried until it succeeds",
            ) from error
        except NotStoredError as error:
            raise CommandFailedError(
                "Not stored",
                f"alarm {id_} is {alarm.state.value}, but the action is not stored, and a restart"
                f" undoes it: {error}",
            ) from error
        return alarm

    async def _require_store(self, alarm: Alarm) -> None:
        try:
            async with asyncio.timeout(ANSWERS_WITHIN_S):
                await self._recorder.require_store()
        except (StoreError, TimeoutError) as error:
            raise CommandFailedError(
                "Action not applied",
                f"alarm {alarm.identity.id} is {alarm.state.value}, as before: an action is applied"
                f" only if it can be stored ({error or 'the store does not respond'})",
            ) from error

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Apply an engineer's action to the baselines of a bearing."""
        await self._films.act(place, action, actor, reason)

    async def refer_to(self, reference: VectorReference) -> None:
        """Set the reference of a bearing's 1× vectors."""
        self._alarms.set_reference(reference)
