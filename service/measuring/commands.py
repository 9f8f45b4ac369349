"""What operators ask, done in the process that measures."""

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
"""How long an operator waits for the disk at most."""

ANSWERS_WITHIN_S = 10.0
"""And how long before that, to see whether it takes anything."""


class LocalCommands:
    """Asks the engine and the keeper of this process."""

    def __init__(self, alarms: AlarmEngine, films: FilmMonitor, recorder: Recorder) -> None:
        self._alarms, self._films, self._recorder = alarms, films, recorder

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Do something to an alarm, and return when it is on the disk.

        While the store takes nothing, nothing is done: what people did must be in the audit trail.
        """
        await self._require_store(self._alarms.alarm(id_))
        alarm = self._alarms.operate(id_, action)
        try:
            async with asyncio.timeout(STORED_WITHIN_S):
                await self._recorder.stored()
        except TimeoutError as error:
            raise CommandFailedError(
                "Not on the disk yet",
                f"alarm {id_} is {alarm.state.value}, but the store does not answer:"
                " a restart now would undo it. It is tried again until it is stored",
            ) from error
        except NotStoredError as error:
            raise CommandFailedError(
                "Not stored",
                f"alarm {id_} is {alarm.state.value}, but this is not in its history, and a restart"
                f" undoes it: {error}",
            ) from error
        return alarm

    async def _require_store(self, alarm: Alarm) -> None:
        try:
            async with asyncio.timeout(ANSWERS_WITHIN_S):
                await self._recorder.require_store()
        except (StoreError, TimeoutError) as error:
            raise CommandFailedError(
                "Nothing was done",
                f"alarm {alarm.identity.id} is {alarm.state.value}, as before: what people do is"
                f" done only if it can be stored ({error or 'the store does not answer'})",
            ) from error

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Do something to the baselines of a bearing."""
        await self._films.act(place, action, actor, reason)

    async def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a new reference."""
        self._alarms.refer_to(reference)
