"""Commands of operators through the database."""

import asyncio
from collections.abc import Callable, Collection
from uuid import uuid4

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from core.alarms.judgements import VectorReference
from core.alarms.operation import Action, ActionRefusedError
from core.units import ns_from_s
from service.cluster.replica_state import ReplicaAlarms
from service.live.commands import (
    BaselineAction,
    BaselineRefusedError,
    FilmPlace,
    NewReference,
    NotCarriedOutError,
    OnAlarm,
    OnBaselines,
    Task,
    UnreadableCommandError,
    read,
    written,
)
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmKeeper
from service.measuring.recorder import NotStoredError, Recorder
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog
from service.store.access.audit_entries import Acting, Source, acting, acting_as
from service.store.port import StoreError
from service.store.sharing import DONE, OPEN, Answer, Command, CommandState, OpenCommand
from service.store.store import Store

WAIT_S = 5.0
"""How long an operator waits for whoever analyses the unit."""

EXPIRES_S = 15.0
"""When nobody may begin any more, should this process not be there to withdraw; by clocks of two
hosts, which may differ by a few seconds."""

LOOK_EVERY_S = 0.1


class Asking:
    """Asks through the database, and answers when it is done."""

    def __init__(self, store: Store, alarms: ReplicaAlarms, clock: Clock) -> None:
        self._store, self._alarms, self._clock = store, alarms, clock

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Do something to an alarm; returns it as it is then, on the disk."""
        unit = self._alarms.owner(id_)
        answer = await self._ask(unit, OnAlarm(id_, action), action.actor)
        if answer.state is CommandState.UNKNOWN:
            raise LookupError(answer.words)
        if answer.state is CommandState.REFUSED:
            raise ActionRefusedError(answer.words)
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        return self._alarms.alarm(id_)

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Do something to the baselines of a bearing."""
        answer = await self._ask(place.unit, OnBaselines(place, action, actor, reason), actor)
        if answer.state is CommandState.REFUSED:
            raise BaselineRefusedError(answer.words)

    async def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a reference that has just been stored."""
        await self._ask(reference.unit, NewReference(reference.unit), acting().actor)

    async def _ask(self, unit: str, task: Task, actor: str) -> Answer:
        """Write it down and wait.

        Raises
        ------
        NotCarriedOutError
            If nobody does it, or it is in doubt.
        """
        command = self._command(unit, task, actor)
        await asyncio.to_thread(self._store.commands.ask, command)
        answer = await self._answer(command)
        if answer.state in (CommandState.WITHDRAWN, CommandState.INTERRUPTED):
            raise NotCarriedOutError("Not carried out", f"unit {unit}: {answer.words}")
        if answer.state in OPEN:
            detail = f"unit {unit}: it is being carried out, but is not on the disk yet"
            raise NotCarriedOutError("Not on the disk yet", detail)
        return answer

    def _command(self, unit: str, task: Task, actor: str) -> Command:
        kind, document = written(task)
        now_ns = self._clock.now_ns()
        expires_ns = now_ns + ns_from_s(EXPIRES_S)
        who = (actor, acting().peer)
        return Command(uuid4().hex, unit, kind, document, *who, now_ns, expires_ns)

    async def _answer(self, command: Command) -> Answer:
        """What has come of a command within a few seconds; what nobody took up is withdrawn."""
        until_s = self._clock.monotonic_s() + WAIT_S
        while True:
            found = await asyncio.to_thread(self._store.commands.look, command.id)
            if found is None:
                return Answer(CommandState.WITHDRAWN, "the command is there no more")
            if found.state not in OPEN:
                return found
            if self._clock.monotonic_s() >= until_s:
                return await asyncio.to_thread(self._give_up, command, found)
            await self._clock.sleep(LOOK_EVERY_S)

    def _give_up(self, command: Command, found: Answer) -> Answer:
        words = (
            f"the process that analyses it has not answered within {WAIT_S:g} s; it is not"
            " carried out later, either"
        )
        if self._store.commands.withdraw(command.id, words, self._clock.now_ns()):
            return Answer(CommandState.WITHDRAWN, words)
        return self._store.commands.look(command.id) or found


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
