"""`CarryingOut`: does what operators ask through the database, in the process that analyses."""

import asyncio
from collections.abc import Callable, Collection

from acquisition.clock import Clock
from core.alarms.operation import ActionRefusedError
from service.live.commands import (
    NewReference,
    OnAlarm,
    OnBaselines,
    Task,
    UnreadableCommandError,
    read,
)
from service.live.film_actions import BaselineRefusedError
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.films.keeper import FilmKeeper
from service.measuring.recorder import NotStoredError, Recorder
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog
from service.store.access.acting import Acting, acting_as
from service.store.access.audit_entry import Source
from service.store.commands_port import DONE, Answer, Command, CommandState, OpenCommand
from service.store.port import Store, StoreError

EVERY_S = 0.25

TOO_LATE = Answer(CommandState.WITHDRAWN, "nobody took it up in time; it is not carried out")
INTERRUPTED = Answer(
    CommandState.INTERRUPTED,
    "the process that carried it out was ended meanwhile: look whether it is done",
)


class CarryingOut:
    """Takes commands up in order, one after the other.

    What is done to an alarm is answered in the transaction that stores its event: a command
    that is still open was not carried out, and whoever analyses the unit next may begin anew.

    Parameters
    ----------
    held
        Which units are this process's just now.
    """

    def __init__(
        self,
        process: str,
        held: Callable[[], Collection[str]],
        alarms: AlarmEngine,
        films: FilmKeeper,
        recorder: Recorder,
        store: Store,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._store, self._clock = process, held, store, clock
        self._alarms, self._films, self._recorder = alarms, films, recorder
        self._trouble = TroubleLog("commands are not carried out", "commands are carried out again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for commands for ever."""
        while True:
            pulse.beat(EVERY_S)
            await self.look()
            pulse.rest()  # a store that does not answer is somebody else's to tell
            await self._clock.sleep(EVERY_S)

    async def look(self) -> None:
        """Carry out what is asked now."""
        try:
            for found in await asyncio.to_thread(self._store.commands.open, self._held()):
                await self._take_up(found)
        except StoreError as error:
            self._trouble.note(str(error))
        else:
            self._trouble.note(None)

    async def _take_up(self, found: OpenCommand) -> None:
        command, commands = found.command, self._store.commands
        answer = self._why_not(found)
        if answer is None:
            if not await asyncio.to_thread(commands.take, command.id, self._process):
                return  # withdrawn meanwhile
            answer = await self._carry_out(command)
        await asyncio.to_thread(commands.answer, command.id, answer, self._clock.now_ns())

    def _why_not(self, found: OpenCommand) -> Answer | None:
        """What is to be said instead of carrying a command out; None if it is to be."""
        if self._clock.now_ns() > found.command.expires_ns:
            return TOO_LATE
        try:
            task = read(found.command.kind, found.command.document)
        except UnreadableCommandError as error:
            return Answer(CommandState.REFUSED, str(error))
        # baselines are written in a transaction of their own: it may be done, or not
        is_in_doubt = isinstance(task, OnBaselines) and found.taken_by is not None
        return INTERRUPTED if is_in_doubt else None

    async def _carry_out(self, command: Command) -> Answer:
        who = Acting(Source.API, command.peer, command.actor, command.id)
        try:
            with acting_as(who):
                await self._do(read(command.kind, command.document))
        except LookupError:
            return Answer(CommandState.UNKNOWN, "there is no such alarm")
        except (ActionRefusedError, BaselineRefusedError) as error:
            return Answer(CommandState.REFUSED, str(error))
        except NotStoredError as error:
            return Answer(
                CommandState.INTERRUPTED,
                f"it is done, but not in the alarm's history, and a restart undoes it: {error}",
            )
        return DONE

    async def _do(self, task: Task) -> None:
        if isinstance(task, OnAlarm):
            self._alarms.operate(task.alarm, task.action)
            await self._recorder.stored()
        elif isinstance(task, OnBaselines):
            await self._films.act(task.place, task.action, task.actor, task.reason)
        elif isinstance(task, NewReference):
            in_force = await asyncio.to_thread(self._store.order1_references.in_force)
            for found in in_force:
                if found.reference.unit == task.unit:
                    self._alarms.refer_to(found.reference)
