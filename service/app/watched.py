"""`Watched`: the parts of a running service that its metrics are read from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from acquisition.clock import Clock
from service.api.load import LoadWatch
from service.live.live_view import LiveView
from service.measuring.alarms.engine import AlarmEngine
from service.measuring.bus import Bus
from service.measuring.films.keeper import FilmKeeper
from service.measuring.metrics.timings import Timings
from service.measuring.recorder import Recorder
from service.measuring.soundness import Soundness
from service.notifications.deliveries import Deliveries
from service.recordings.capture.captures import Captures
from service.recordings.continuous.tape import Tape
from service.recordings.keeping.keeper import WaveformKeeper
from service.reports.keeper import EvidenceKeeper
from service.runtime.polls import TimedSource
from service.runtime.space.watch import SpaceWatch


@dataclass(frozen=True)
class Watched:
    """Where metrics come from; nothing of it is changed.

    Parameters
    ----------
    bearings
        Of every unit.
    sources
        Where samples come from, by unit; of those that are timed.
    space
        Knows how full the disks are; None where nobody looks.
    load
        Knows which questions are refused now; None where none ever are.
    tape, recordings
        Continuous recording, and what looks after recordings; None where nothing does.
    soundness
        Knows what of the stored data is damaged; None where nobody looks.
    store_kind
        Which database results are in, as `Store.kind` says it; None if that is not told.
    """

    bearings: Mapping[str, Sequence[str]]
    live: LiveView
    bus: Bus
    recorder: Recorder
    alarms: AlarmEngine
    films: FilmKeeper
    captures: Captures
    evidence: EvidenceKeeper
    deliveries: Deliveries
    timings: Timings
    clock: Clock
    sources: Mapping[str, TimedSource] = field(default_factory=dict)
    space: SpaceWatch | None = None
    load: LoadWatch | None = None
    tape: Tape | None = None
    recordings: WaveformKeeper | None = None
    soundness: Soundness | None = None
    store_kind: str | None = None
