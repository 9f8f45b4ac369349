"""Background task that indexes, checks and removes recordings, in one process per data folder."""

import asyncio
import fcntl
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import structlog

from acquisition.clock import Clock
from service.recordings.retention import (
    FirstError,
    RecordingRetention,
    RetentionCounts,
    SpaceGauge,
)
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.waveforms import WaveformKind

log = structlog.get_logger()

LOCK = "recordings.lock"


class RecordingLock:
    """File lock of the process that maintains the recordings; released when the process ends."""

    def __init__(self, data_folder: Path) -> None:
        self._path = data_folder / LOCK
        self._descriptor: int | None = None

    def acquire(self) -> bool:
        """Acquire the lock if it is free; return whether this process holds it.

        Raises `OSError` if the lock file cannot be created.
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
        """Release the lock."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


LOOK_EVERY_S = 5.0

SHARE = 0.02
"""Maximum fraction of time spent in runs of `RecordingIndexer`."""

MAX_LOOK_S = 600.0
"""Maximum duration of a run in seconds; a run may read a whole large recording."""

LASTING_S = 60.0
"""Time in seconds for which runs must fail before an alarm is raised."""


class RecordingIndexer:
    """Background task that maintains the index and the folders of recordings.

    Parameters
    ----------
    gauge
        Measurement of the free space, also performed by processes without the lock.
    open_retention
        Function that returns the retention; called in the thread, and again after an error.
    lock
        Lock of the process that maintains the recordings.

    Attributes
    ----------
    faults
        Fault of each damaged recording, by name.
    n_files, n_bytes
        Number and total size of the recordings on the disk, by kind.
    trouble
        First error of the last run; None if the run succeeded.
    """

    def __init__(
        self,
        gauge: SpaceGauge,
        open_retention: Callable[[], RecordingRetention],
        clock: Clock,
        lock: RecordingLock,
    ) -> None:
        self._gauge = gauge
        self._open_retention, self._clock, self._lock = open_retention, clock, lock
        self._retention: RecordingRetention | None = None
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="waveforms")
        self.faults: Mapping[str, str] = {}
        self.n_files: Mapping[WaveformKind, int] = {}
        self.n_bytes: Mapping[WaveformKind, int] = {}
        self.trouble: str | None = None
        self._failing_since_s = 0.0

    @property
    def found(self) -> RetentionCounts:
        """Numbers of indexed, checked, damaged, missing and removed recordings since the start."""
        return self._retention.found if self._retention else RetentionCounts()

    @property
    def n_lost(self) -> int:
        """Number of recordings found damaged or missing since the start."""
        return self.found.n_damaged + self.found.n_missing

    @property
    def lasting_trouble(self) -> str | None:
        """Reason why all runs have failed for at least `LASTING_S`; None otherwise."""
        lasts_s = self._clock.monotonic_s() - self._failing_since_s
        if self.trouble is None or lasts_s < LASTING_S:
            return None
        return f"recordings are not maintained: {self.trouble}"

    def is_full(self) -> bool:
        """Return whether too little space is left for continuous recording."""
        return self._gauge.is_full

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Maintain the recordings until cancelled, with heartbeats to `pulse`; then `close`."""
        while True:
            pulse.beat(MAX_LOOK_S)
            start_s = self._clock.monotonic_s()
            await asyncio.get_running_loop().run_in_executor(self._thread, self.look)
            taken_s = self._clock.monotonic_s() - start_s
            pause_s = min(max(LOOK_EVERY_S, taken_s / SHARE), MAX_LOOK_S)
            pulse.beat(pause_s)
            await self._clock.sleep(pause_s)

    def close(self) -> None:
        """Stop the thread and release the lock."""
        self._thread.shutdown(wait=False)
        self._lock.release()

    def look(self) -> None:
        """Measure the free space; maintain recordings if the lock is free; set `trouble`."""
        errors = FirstError()
        with errors.deferred():
            self._gauge.measure()  # first, as later steps may take long or fail
        with errors.deferred():
            if self._lock.acquire():
                self._retention = self._retention or self._open_retention()
                self._retention.look()
        self._note(None if errors.first is None else str(errors.first))
        if self._retention is not None:
            files = self._retention.on_disk
            self.faults = self._retention.faults
            self.n_files = {k: sum(file.kind is k for file in files) for k in WaveformKind}
            self.n_bytes = {k: sum(f.n_bytes for f in files if f.kind is k) for k in WaveformKind}

    def _note(self, trouble: str | None) -> None:
        if trouble is not None and trouble != self.trouble:
            log.error("recordings are not maintained", reason=trouble)
        if self.trouble is None:
            self._failing_since_s = self._clock.monotonic_s()
        self.trouble = trouble
