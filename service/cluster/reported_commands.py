"""Operator commands that a replica stores in the database and an analysing process executes."""

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
    AlarmCommand,
    BaselineAction,
    BaselineCommand,
    BaselineRefusedError,
    CommandFailedError,
    FilmPlace,
    OperatorCommand,
    ReferenceCommand,
    UnreadableCommandError,
    decoded,
    encoded,
)
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.recorder import NotStoredError, Recorder
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.access.audit_entries import Acting, Source, acting, acting_as
from service.store.port import StoreError
from service.store.sharing import DONE, OPEN, Answer, Command, CommandState, OpenCommand
from service.store.store import Store

WAIT_S = 5.0
"""Maximum wait of a replica for the answer of the analysing process, s."""

EXPIRES_S = 15.0
"""Age above which a command is not executed, s, in case the replica cannot withdraw it. The clocks
of the two hosts may differ by a few seconds."""

POLL_EVERY_S = 0.1


class CommandClient:
    """Client that stores operator commands in the database and waits for the answers."""

    def __init__(self, store: Store, alarms: ReplicaAlarms, clock: Clock) -> None:
        self._store, self._alarms, self._clock = store, alarms, clock

    async def operate(self, id_: str, action: Action) -> Alarm:
        """Apply an operator's action to the alarm with an id; return the alarm as then stored."""
        unit = self._alarms.owner(id_)
        answer = await self._send(unit, AlarmCommand(id_, action), action.actor)
        if answer.state is CommandState.UNKNOWN:
            raise LookupError(answer.words)
        if answer.state is CommandState.REFUSED:
            raise ActionRefusedError(answer.words)
        self._alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        return self._alarms.alarm(id_)

    async def act(self, place: FilmPlace, action: BaselineAction, actor: str, reason: str) -> None:
        """Apply an engineer's action to the baselines of a bearing.

        Raises `BaselineRefusedError` if the action does not fit the state of the baselines.
        """
        answer = await self._send(place.unit, BaselineCommand(place, action, actor, reason), actor)
        if answer.state is CommandState.REFUSED:
            raise BaselineRefusedError(answer.words)

    async def refer_to(self, reference: VectorReference) -> None:
        """Put a stored reference of 1× vectors in force in the analysing process."""
        await self._send(reference.unit, ReferenceCommand(reference.unit), acting().actor)

    async def _send(self, unit: str, task: OperatorCommand, actor: str) -> Answer:
        """Store a command and wait for its answer.

        Raises `CommandFailedError` if the command is not executed, or its outcome is unknown.
        """
        command = self._command(unit, task, actor)
        await asyncio.to_thread(self._store.commands.ask, command)
        answer = await self._answer(command)
        if answer.state in (CommandState.WITHDRAWN, CommandState.INTERRUPTED):
            raise CommandFailedError("Command not executed", f"unit {unit}: {answer.words}")
        if answer.state in OPEN:
            detail = f"unit {unit}: the command is in progress but not stored yet"
            raise CommandFailedError("Not stored yet", detail)
        return answer

    def _command(self, unit: str, task: OperatorCommand, actor: str) -> Command:
        kind, document = encoded(task)
        now_ns = self._clock.now_ns()
        expires_ns = now_ns + ns_from_s(EXPIRES_S)
        who = (actor, acting().peer)
        return Command(uuid4().hex, unit, kind, document, *who, now_ns, expires_ns)

    async def _answer(self, command: Command) -> Answer:
        """Wait for the answer to a command; withdraw the command if no answer arrives in time."""
        until_s = self._clock.monotonic_s() + WAIT_S
        while True:
            found = await asyncio.to_thread(self._store.commands.look, command.id)
            if found is None:
                return Answer(CommandState.WITHDRAWN, "the command no longer exists")
            if found.state not in OPEN:
                return found
            if self._clock.monotonic_s() >= until_s:
                return await asyncio.to_thread(self._give_up, command, found)
            await self._clock.sleep(POLL_EVERY_S)

    def _give_up(self, command: Command, found: Answer) -> Answer:
        words = (
            f"the process of the unit has not replied within {WAIT_S:g} s; the command was"
            " withdrawn"
        )
        if self._store.commands.withdraw(command.id, words, self._clock.now_ns()):
            return Answer(CommandState.WITHDRAWN, words)
        return self._store.commands.look(command.id) or found


READ_EVERY_S = 0.25

TOO_LATE = Answer(CommandState.WITHDRAWN, "no process accepted the command in time")
INTERRUPTED = Answer(
    CommandState.INTERRUPTED,
    "the process ended during the execution of the command; check the result",
)


class CommandWorker:
    """Worker that executes the commands on the units of this process, one after the other.

    An alarm command is marked as answered in the transaction that stores the alarm event. An open
    alarm command was therefore not executed, and another process can execute it.
    """

    def __init__(
        self,
        process: str,
        held: Callable[[], Collection[str]],
        alarms: AlarmEngine,
        films: FilmMonitor,
        recorder: Recorder,
        store: Store,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._store, self._clock = process, held, store, clock
        self._alarms, self._films, self._recorder = alarms, films, recorder
        self._trouble = TroubleLog("commands are not executed", "commands are executed again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Execute open commands periodically, until cancelled."""

        async def look() -> None:
            await self.look()
            pulse.rest()  # waiting for a slow store is not a fault of this loop

        await periodic(look, READ_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Execute the open commands on the units of this process once."""
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
                return  # the sender has withdrawn the command
            answer = await self._carry_out(command)
        await asyncio.to_thread(commands.answer, command.id, answer, self._clock.now_ns())

    def _why_not(self, found: OpenCommand) -> Answer | None:
        """Return the refusal of a command that must not be executed; None if it may be executed."""
        if self._clock.now_ns() > found.command.expires_ns:
            return TOO_LATE
        try:
            task = decoded(found.command.kind, found.command.document)
        except UnreadableCommandError as error:
            return Answer(CommandState.REFUSED, str(error))
        # baselines and answer are stored in separate transactions: the outcome is unknown
        is_in_doubt = isinstance(task, BaselineCommand) and found.taken_by is not None
        return INTERRUPTED if is_in_doubt else None

    async def _carry_out(self, command: Command) -> Answer:
        who = Acting(Source.API, command.peer, command.actor, command.id)
        try:
            with acting_as(who):
                await self._do(decoded(command.kind, command.document))
        except LookupError:
            return Answer(CommandState.UNKNOWN, "the alarm does not exist")
        except (ActionRefusedError, BaselineRefusedError) as error:
            return Answer(CommandState.REFUSED, str(error))
        except NotStoredError as error:
            return Answer(
                CommandState.INTERRUPTED,
                f"the command was executed but not stored, and a restart undoes it: {error}",
            )
        return DONE

    async def _do(self, task: OperatorCommand) -> None:
        if isinstance(task, AlarmCommand):
            self._alarms.operate(task.alarm, task.action)
            await self._recorder.stored()
        elif isinstance(task, BaselineCommand):
            await self._films.act(task.place, task.action, task.actor, task.reason)
        elif isinstance(task, ReferenceCommand):
            in_force = await asyncio.to_thread(self._store.order1_references.in_force)
            for found in in_force:
                if found.reference.unit == task.unit:
                    self._alarms.set_reference(found.reference)
