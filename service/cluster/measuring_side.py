"""Measuring side of a cluster: writes reports to the database, and executes its commands."""

import asyncio
from collections.abc import Callable, Collection, Iterable

from acquisition.clock import Clock
from service.live.commands import BASELINE_ACTIONS
from service.live.snapshot import UnitReport, link_document, snapshot_document
from service.measuring.commands import CommandExecutor
from service.measuring.snapshots import LINK_EVERY_S, SnapshotBuilder
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.access.audit_entries import Acting, Source
from service.store.port import StoreError
from service.store.sharing import Answer, CommandState, OpenCommand, UnitRow, UnitStates
from service.store.store import Store


class Reporter:
    """Writer of reports on units to the database, from which the serving processes read them.

    `held` returns the ids of the units that this process is responsible for, also `PLANT` if it
    reports the alarms without a unit, `SHARED` if it runs the plant-wide tasks.
    """

    def __init__(
        self,
        process: str,
        held: Callable[[], Iterable[str]],
        builder: SnapshotBuilder,
        store: UnitStates,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._store, self._clock = process, held, store, clock
        self._builder = builder
        self._written: dict[str, int | None] = {}
        self._n_beats = 0
        self._trouble = TroubleLog("unit states are not reported", "unit states are reported again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write reports on all units to the store periodically, until cancelled.

        `pulse` receives a heartbeat after each report.
        """
        await periodic(self.report, LINK_EVERY_S, self._clock, pulse)

    async def report(self) -> None:
        """Write one report on each unit; after failed writes, readers treat the units as silent."""
        found = [self._builder.report(unit) for unit in self._held()]
        if not found:
            return
        self._n_beats += 1
        # a snapshot is written again after a failure, and after another process wrote the unit
        held = {each.unit: self._written.get(each.unit) for each in found}
        self._written = dict.fromkeys(held)
        rows = [self._row(each, held[each.unit]) for each in found]
        try:
            await asyncio.to_thread(self._store.report, self._process, rows)
        except StoreError as error:
            self._trouble.note(str(error))
            return
        self._trouble.note(None)
        self._written = {each.unit: each.revision for each in found}

    def _row(self, report: UnitReport, written: int | None) -> UnitRow:
        status, snapshot = report.link.status, report.snapshot
        is_new = snapshot is not None and report.revision != written
        return UnitRow(
            unit=report.unit,
            n_beats=self._n_beats,
            beat_ns=self._clock.now_ns(),
            link=status.state.value,
            reason=status.reason,
            last_sample_ns=status.last_sample_ns,
            signs=link_document(report.link),
            revision=report.revision,
            state=snapshot_document(snapshot) if is_new and snapshot is not None else None,
        )


COMMANDS_EVERY_S = 0.25

TOO_LATE = Answer(CommandState.WITHDRAWN, "no process accepted the command in time")
INTERRUPTED = Answer(
    CommandState.INTERRUPTED,
    "the process ended during the execution of the command; check the result",
)


class CommandWorker:
    """Worker that executes the operators' commands on the units `held` by this process, in turn.

    An alarm command is marked as answered in the transaction that stores the alarm event. An open
    alarm command was therefore not executed, and another process can execute it.
    """

    def __init__(
        self,
        process: str,
        held: Callable[[], Collection[str]],
        executor: CommandExecutor,
        store: Store,
        clock: Clock,
    ) -> None:
        self._process, self._held, self._executor = process, held, executor
        self._store, self._clock = store, clock
        self._trouble = TroubleLog("commands are not executed", "commands are executed again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Execute open commands periodically, until cancelled; `pulse` gets heartbeats."""

        async def look() -> None:
            await self.look()
            pulse.rest()  # waiting for a slow store is not a fault of this loop

        await periodic(look, COMMANDS_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Execute all operators' commands on the units of this process that are open now."""
        try:
            for found in await asyncio.to_thread(self._store.commands.open, self._held()):
                await self._take_up(found)
        except StoreError as error:
            self._trouble.note(str(error))
        else:
            self._trouble.note(None)

    async def _take_up(self, found: OpenCommand) -> None:
        command, commands = found.command, self._store.commands
        if self._clock.now_ns() > command.expires_ns:
            answer = TOO_LATE
        elif found.taken_by is not None and command.kind in BASELINE_ACTIONS:
            answer = INTERRUPTED  # baselines and answer are stored in separate transactions
        elif await asyncio.to_thread(commands.take, command.id, self._process):
            who = Acting(Source.API, command.peer, command.actor, command.id)
            answer = await self._executor.execute(command.kind, command.document, who)
        else:
            return  # the sender has withdrawn the command
        await asyncio.to_thread(commands.answer, command.id, answer, self._clock.now_ns())
