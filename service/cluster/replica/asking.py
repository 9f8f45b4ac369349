"""`Asking`: operators' wishes, written down for whoever analyses the unit, and awaited."""

import asyncio
from uuid import uuid4

from acquisition.clock import Clock
from core.alarms.alarm import Alarm
from core.alarms.judgements import VectorReference
from core.alarms.operation import Action, ActionRefusedError
from core.units import ns_from_s
from service.cluster.replica.alarms import ReplicaAlarms
from service.live.commands import NewReference, OnAlarm, OnBaselines, Task, written
from service.live.elsewhere import NotCarriedOutError
from service.live.film_actions import Action as BaselineAction
from service.live.film_actions import BaselineRefusedError, FilmPlace
from service.store.access.acting import acting
from service.store.commands_port import OPEN, Answer, Command, CommandState
from service.store.port import Store

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
