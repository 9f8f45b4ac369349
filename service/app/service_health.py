"""Health of the service for its alarms, and backpressure on continuous recording."""

from collections.abc import Callable, Iterable

from service.measuring.acquirer import Bus
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.measuring.service_alarms import HealthProbe, ServiceHealth, StreamStatus
from service.recordings.around_alarms import Captures
from service.recordings.continuous_recorder import ContinuousRecorder, DropReason
from service.recordings.keeper import RecordingIndexer
from service.runtime.disk import SpaceWatch


def health_of(
    units: Iterable[str],
    live: LiveView,
    recorder: Recorder,
    captures: Captures,
    bus: Bus,
    space: SpaceWatch,
    tape: ContinuousRecorder,
    recordings: RecordingIndexer,
    soundness: IntegrityMonitor,
    stream: StreamStatus | None = None,
) -> HealthProbe:
    """Return a function without arguments that returns the present health of the service."""
    names = list(units)

    def look() -> ServiceHealth:
        return ServiceHealth(
            store_error=live.store_error,
            store_behind_s=recorder.behind_s,
            n_unstored=live.n_unstored,
            unstored_reason=live.unstored_reason,
            n_recordings_damaged=recordings.n_lost,
            readings={
                "waiting_share": bus.depth / bus.capacity,
                "analysis_delay_s": max(bus.oldest_wait_s, stream.behind_s() if stream else 0.0),
                "captures_error": captures.trouble,
                "recording_error": recording_error(tape, recordings),
                "stored_trouble": soundness.trouble,
                "stream_trouble": stream.trouble() if stream else None,
            },
            accounts={
                unit: status.account
                for unit in names
                if (status := live.status(unit)).last_sample_ns is not None
            },
            disk=space.condition,
        )

    return look


def recording_error(tape: ContinuousRecorder, recordings: RecordingIndexer) -> str | None:
    """Return the error of the continuous recorder or of the indexer; None without an error."""
    return tape.trouble or recordings.lasting_trouble


BEHIND_S = 3.0
"""Waiting time of a block, s, above which recording pauses; the analysis has priority."""

BEHIND_SHARE = 0.25
"""Filled share of the block queue above which recording pauses."""

CAUGHT_UP = 1.0 / 3.0
"""Share of `BEHIND_S` and `BEHIND_SHARE` below which recording resumes."""


class Pressure:
    """Control that pauses recording while the analysis is behind or the disk is nearly full.

    `is_full` returns whether the disk is nearly full.
    """

    def __init__(self, bus: Bus, is_full: Callable[[], bool]) -> None:
        self._bus, self._is_full = bus, is_full
        self._is_behind = False

    def look(self) -> DropReason | None:
        """Return the reason why recording must pause now; None if it may continue."""
        share = CAUGHT_UP if self._is_behind else 1.0
        self._is_behind = (
            self._bus.oldest_wait_s > share * BEHIND_S
            or self._bus.depth > share * BEHIND_SHARE * self._bus.capacity
        )
        if self._is_behind:
            return DropReason.ANALYSIS_BEHIND
        return DropReason.DISK_FULL if self._is_full() else None
