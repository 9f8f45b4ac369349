"""The loop that looks after the recordings of a folder, in one process."""

import asyncio
import fcntl
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import MappingProxyType

import structlog

from acquisition.clock import Clock
from service.recordings.retention import Caretaker, Findings, Gauge, Troubles
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.waveforms import WaveformFile, WaveformKind

log = structlog.get_logger()

LOCK = "recordings.lock"


class WatchKeeping:
    """Held until the process ends, however that happens; the file means nothing by itself."""

    def __init__(self, data_folder: Path) -> None:
        self._path = data_folder / LOCK
        self._descriptor: int | None = None

    def take(self) -> bool:
        """Whether this process is the one; asks anew each time until it is.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        if self._descriptor is not None:
            return True
        self._path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            return False
        self._descriptor = descriptor
        return True

    def release(self) -> None:
        """Let another process do it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


LOOK_EVERY_S = 5.0

SHARE = 0.02
"""Of the time that goes into looking, however many recordings there are."""

MAX_LOOK_S = 600.0
"""Longest that a look may take: a large recording is read from end to end."""

TOLD_AFTER_S = 60.0
"""For how long something has to fail before an alarm tells of it: what passes is done next time."""

NONE_DAMAGED: Mapping[str, str] = MappingProxyType({})


class WaveformKeeper:
    """Keeps index and folders of recordings together while the service runs.

    Parameters
    ----------
    gauge
        Says how much room is left, whoever looks after the recordings, and if nobody can.
    hire
        Makes the caretaker; called in the thread, and again while the store or the disk refuses.
    watch
        Says whether it is this process that looks after them.

    Attributes
    ----------
    faults
        Why each damaged recording is not served, by name.
    n_files, n_bytes
        Recordings on the disk, by kind.
    trouble
        Why something of the last look failed; None if nothing did.
    """

    def __init__(
        self, gauge: Gauge, hire: Callable[[], Caretaker], clock: Clock, watch: WatchKeeping
    ) -> None:
        self._gauge = gauge
        self._hire, self._clock, self._watch = hire, clock, watch
        self._caretaker: Caretaker | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="waveforms")
        self.faults = NONE_DAMAGED
        self.n_files: Mapping[WaveformKind, int] = {}
        self.n_bytes: Mapping[WaveformKind, int] = {}
        self.trouble: str | None = None
        self._trouble_from_s: float | None = None

    @property
    def found(self) -> Findings:
        """What was found and done since the start."""
        return self._caretaker.found if self._caretaker else Findings()

    @property
    def n_lost(self) -> int:
        """Recordings that were found damaged or missing since the start."""
        return self.found.n_damaged + self.found.n_missing

    @property
    def lasting_trouble(self) -> str | None:
        """Why recordings are not looked after as they should be, if that goes on for a minute."""
        if self.trouble is None or self._trouble_from_s is None:
            return None
        if self._clock.monotonic_s() - self._trouble_from_s < TOLD_AFTER_S:
            return None
        return f"recordings are not looked after: {self.trouble}"

    def is_full(self) -> bool:
        """Whether there is no room for more of what can be done without."""
        return self._gauge.is_full

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for ever."""
        while True:
            pulse.beat(MAX_LOOK_S)
            start_s = self._clock.monotonic_s()
            await asyncio.get_running_loop().run_in_executor(self._thread, self.look)
            took_s = self._clock.monotonic_s() - start_s
            pause_s = min(max(LOOK_EVERY_S, took_s / SHARE), MAX_LOOK_S)
            pulse.beat(pause_s)
            await self._clock.sleep(pause_s)

    def close(self) -> None:
        """Let go of the thread."""
        self._thread.shutdown(wait=False)
        self._watch.release()

    def look(self) -> None:
        """Look once; in the thread."""
        troubles = Troubles()
        with troubles.borne():
            self._gauge.measure()  # first of all: what comes then may take long, or fail
        with troubles.borne():
            if self._watch.take():
                self._caretaker = self._caretaker or self._hire()
                self._caretaker.look()
        self._tell(None if troubles.first is None else str(troubles.first))
        if self._caretaker is not None:
            self._count(self._caretaker)

    def _count(self, caretaker: Caretaker) -> None:
        files: Sequence[WaveformFile] = caretaker.on_disk
        self.faults = caretaker.faults
        self.n_files = {k: sum(file.kind is k for file in files) for k in WaveformKind}
        self.n_bytes = {k: sum(f.n_bytes for f in files if f.kind is k) for k in WaveformKind}

    def _tell(self, trouble: str | None) -> None:
        if trouble is not None and trouble != self.trouble:
            log.error("recordings are not looked after", reason=trouble)
        if trouble is None:
            self._trouble_from_s = None
        elif self._trouble_from_s is None:
            self._trouble_from_s = self._clock.monotonic_s()
        self.trouble = trouble
