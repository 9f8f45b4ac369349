"""Serving side of a cluster: reads reports from the database, and writes operators' commands."""

import asyncio
from collections.abc import Sequence
from typing import Any
from uuid import uuid4

import structlog

from acquisition.clock import Clock
from core.units import ns_from_s
from service.live.client import LiveClient
from service.live.commands import OperatorCommand, encoded
from service.live.receivers import (
    ReceiverView,
    SenderState,
    with_backlogs,
)
from service.live.snapshot import (
    Report,
    UnitReport,
    UnreadableError,
    link_of_document,
    snapshot_of_document,
)
from service.notifications.sender import Receiver
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.access.audit_entries import acting
from service.store.outbox import Outbox
from service.store.port import StoreError
from service.store.sharing import OPEN, Answer, Command, CommandState, UnitBeat
from service.store.store import Store

log = structlog.get_logger()

READ_EVERY_S = 0.5

Revision = tuple[str, int]
"""Id of a process, and revision of the unit state that it wrote."""


class Feed:
    """Reader of the reports on units in the database, for the serving process of a cluster."""

    def __init__(self, store: Store, live: LiveClient, clock: Clock) -> None:
        self._store, self._live, self._clock = store, live, clock
        self._revisions: dict[str, Revision] = {}
        self._unreadable: str | None = None
        self._trouble = TroubleLog("unit states cannot be read", "unit states can be read again")

    async def start(self) -> None:
        """Read the stored alarms and the reports; call it before the first request is served.

        Raises `StoreError` if the database cannot be read.
        """
        self._live.alarms.take_stored(await asyncio.to_thread(self._store.alarms))
        await self._take()

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Read the reports periodically, until cancelled; `pulse` gets heartbeats."""
        await periodic(self.look, READ_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Read the reports once; after a failure the old values remain, and their ages increase."""
        with self._trouble.noting(StoreError):
            await self._take()
        self._live.units.read_error = self._trouble.trouble

    async def _take(self) -> None:
        for report in await asyncio.to_thread(self._read):
            await self._live.take(report)

    def _read(self) -> list[Report]:
        states = self._store.unit_states
        beats = [beat for beat in states.beats() if beat.unit in self._live.units.units]
        new = [b.unit for b in beats if self._revisions.get(b.unit) != (b.process, b.revision)]
        documents = states.states(new) if new else {}
        found = (self._report(beat, documents.get(beat.unit)) for beat in beats)
        return [each for each in found if each is not None]

    def _report(self, beat: UnitBeat, document: tuple[str, int, bytes] | None) -> Report | None:
        """Decode a report; log an unreadable report once and return None."""
        try:
            # the snapshot first, whose error names both versions
            snapshot = None if document is None else snapshot_of_document(document[2])
            link = link_of_document(beat.signs)
        except UnreadableError as error:
            if str(error) != self._unreadable:
                reason = self._unreadable = str(error)
                log.error(
                    "a unit state from the measuring process cannot be read",
                    unit=beat.unit,
                    reason=reason,
                )
            return None
        if document is not None:
            self._revisions[beat.unit] = document[:2]
        unit = UnitReport(beat.unit, link, beat.revision, snapshot)
        return Report(beat.process, beat.n_beats, (unit,), None)


WAIT_S = 5.0
"""Maximum wait of a replica for an answer of the process that analyses the unit, s."""

EXPIRES_S = 15.0
"""Age above which a command is not executed, s, in case the replica cannot withdraw it. The clocks
of the two hosts may differ by a few seconds."""

POLL_EVERY_S = 0.1


class DatabaseSender:
    """Sender of operators' commands through the database to the process that analyses the unit."""

    def __init__(self, store: Store, clock: Clock) -> None:
        self._store, self._clock = store, clock

    async def send(self, unit: str, command: OperatorCommand, actor: str) -> Answer:
        """Store a command and return its answer; withdraw it if no answer arrives in `WAIT_S`.

        ``actor`` is the operator's user name. Raises `StoreError` if the database cannot be used.
        """
        stored = self._command(unit, command, actor)
        await asyncio.to_thread(self._store.commands.ask, stored)
        return await self._answer(stored)

    def _command(self, unit: str, task: OperatorCommand, actor: str) -> Command:
        kind, document = encoded(task)
        now_ns = self._clock.now_ns()
        expires_ns = now_ns + ns_from_s(EXPIRES_S)
        who = (actor, acting().peer)
        return Command(uuid4().hex, unit, kind, document, *who, now_ns, expires_ns)

    async def _answer(self, command: Command) -> Answer:
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


def replica_receivers(receivers: Sequence[Receiver], outbox: Outbox) -> list[ReceiverView]:
    """Return the state of the notification receivers from their oldest messages in the outbox.

    Raises `StoreError` if the outbox cannot be read.
    """
    return with_backlogs([each.view(**_status(outbox, each.name)) for each in receivers], outbox)


def _status(outbox: Outbox, name: str) -> dict[str, Any]:
    """Return the sender status of a receiver, from its oldest waiting message."""
    for first in outbox.waiting(name, 1):
        if not first.n_attempts:
            return {"state": SenderState.SENDING}
        return {
            "state": SenderState.RETRYING,
            "n_failures": first.n_attempts,
            "failing_since_ns": first.queued_ns,
            "reason": first.answer,
        }
    return {}
