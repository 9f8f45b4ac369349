"""Measuring side of a cluster: writes reports to the database, and executes its commands."""

import asyncio
from collections.abc import Callable, Collection

from acquisition.clock import Clock
from service.live.commands import BASELINE_ACTIONS
from service.live.snapshot import UnitReport, link_document, snapshot_document
from service.measuring.commands import CommandExecutor
from service.measuring.snapshots import Reports
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.access.audit_entries import Acting, Source
from service.store.port import StoreError
from service.store.sharing import Answer, CommandState, OpenCommand, UnitRow, UnitStates
from service.store.store import Store

REPORT_EVERY_S = 1.0
"""Period of reports, s: a unit without reports counts as not analysed."""


class Reporter:
    """Writer of reports on units to the database, from which the serving processes read them."""

    def __init__(self, reports: Reports, store: UnitStates, clock: Clock) -> None:
        self._reports, self._store, self._clock = reports, store, clock
        self._is_written = False
        self._trouble = TroubleLog("unit states are not reported", "unit states are reported again")

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Write reports on all units to the store periodically, until cancelled.

        `pulse` receives a heartbeat after each report.
        """
        await periodic(self.report, REPORT_EVERY_S, self._clock, pulse)

    async def report(self) -> None:
        """Write one report on each unit; after failed writes, readers treat the units as silent."""
        report = self._reports.report(is_first=not self._is_written)  # again after a failure
        rows = [self._row(each, report.number) for each in report.units]
        self._is_written = False
        with self._trouble.noting(StoreError):
            await asyncio.to_thread(self._store.report, report.process, rows)
            self._is_written = True

    def _row(self, report: UnitReport, number: int) -> UnitRow:
        snapshot = report.snapshot
        return UnitRow(
            unit=report.unit,
            n_beats=number,
            beat_ns=self._clock.now_ns(),
            signs=link_document(report.link),
            revision=report.revision,
            state=None if snapshot is None else snapshot_document(snapshot),
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
        with self._trouble.noting(StoreError):
            for found in await asyncio.to_thread(self._store.commands.open, self._held()):
                await self._take_up(found)

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
