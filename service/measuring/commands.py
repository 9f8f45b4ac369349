"""Execution of operators' commands, and answers to questions of the serving process."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from acquisition.clock import Clock
from core.alarms.operation import ActionRefusedError
from service.live.commands import (
    AlarmCommand,
    BaselineCommand,
    BaselineRefusedError,
    ReferenceRefusedError,
    TakeReference,
    decoded,
)
from service.live.exchange import Question
from service.live.snapshot import UnreadableError
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.films import FilmMonitor
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import NotStoredError, Recorder
from service.measuring.references import measured_vectors
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.notes import Note, note_action
from service.store.port import StoreError
from service.store.references import SetVectorReference
from service.store.sharing import DONE, Answer, CommandState
from service.store.store import Store

WITHIN_S = 10.0
"""Maximum wait for the store before a command is carried out, and until it is on the disk, s."""

REFUSALS = ActionRefusedError, BaselineRefusedError, ReferenceRefusedError, UnreadableError
"""Errors with which a command is refused; nothing is changed."""


@dataclass(frozen=True)
class CommandExecutor:
    """Executor of operators' commands; it answers `DONE` when the result is on the disk."""

    alarms: AlarmEngine
    films: FilmMonitor
    live: LiveView
    recorder: Recorder
    store: Store
    clock: Clock

    async def execute(self, kind: str, document: str, who: Acting) -> Answer:
        """Execute a command of the actor `who`; return the answer once the result is stored.

        `kind` and `document` are those of `service.live.commands.encoded`.
        """
        try:
            with acting_as(who):
                match command := decoded(kind, document):
                    case AlarmCommand():
                        self.alarms.alarm(command.alarm)  # before the store is tried
                        async with asyncio.timeout(WITHIN_S):
                            await self.recorder.require_store()
                        self.alarms.operate(command.alarm, command.action)
                        return await self._stored()
                    case BaselineCommand(place, action, actor, reason):
                        await self.films.act(place, action, actor, reason)
                    case TakeReference():
                        await self._take_reference(command)
                    case Note():
                        added = note_action(command, self.clock.now_ns())
                        await asyncio.to_thread(self.store.audit.record, [added])
                return DONE
        except LookupError:
            return Answer(CommandState.UNKNOWN, "the alarm does not exist")
        except REFUSALS as error:
            return Answer(CommandState.REFUSED, str(error))
        except NotStoredError as error:
            words = "the command was executed but not stored, and a restart undoes it"
            return Answer(CommandState.INTERRUPTED, f"{words}: {error}")
        except (StoreError, TimeoutError) as error:
            words = "the action is withdrawn, because storing it failed"
            return Answer(
                CommandState.WITHDRAWN, f"{words}: {error or 'the store does not respond'}"
            )

    async def _stored(self) -> Answer:
        try:
            async with asyncio.timeout(WITHIN_S):
                await self.recorder.stored()
        except TimeoutError:
            words = "a restart now would undo the command; storing is retried until it succeeds"
            return Answer(CommandState.TAKEN, words)
        return DONE

    async def _take_reference(self, command: TakeReference) -> None:
        current = self.live.current(command.unit, command.bearing)
        measured = measured_vectors(current.assessment if current.is_current else None)
        found = SetVectorReference(measured, self.clock.now_ns(), command.actor, command.note)
        await asyncio.to_thread(self.store.order1_references.add, found)
        self.alarms.set_reference(measured)


@dataclass
class Questions:
    """Handler of the questions that the serving process asks the measuring process.

    Faults of the database of accounts are reported to `integrity`. `metrics` returns the metrics of
    the measuring process in the Prometheus text format. `on_ready` is called with URL and set-up
    token (None if an account exists) when requests are served for the first time.
    """

    executor: CommandExecutor
    integrity: IntegrityMonitor
    metrics: Callable[[], Awaitable[bytes]]
    on_ready: Callable[[str, str | None], None] = lambda *_: None
    _is_ready: bool = field(default=False, init=False)

    async def answer(self, question: Question) -> object:
        """Return the answer to a question: an `Answer` to a command, None to a reported fault."""
        match question.kind:
            case "blocks":
                (unit,) = json.loads(question.document)
                return self.executor.live.blocks(unit)
            case "result":
                unit, bearing = json.loads(question.document)
                return self.executor.live.assessment(unit, bearing)
            case "access":
                (self.integrity.access_trouble,) = json.loads(question.document)
                return None
            case "metrics":
                return await self.metrics()
            case "ready":
                if not self._is_ready:
                    self._is_ready = True
                    self.on_ready(*json.loads(question.document))
                return None
        who = Acting(Source.API, question.peer, question.actor)
        return await self.executor.execute(question.kind, question.document, who)
