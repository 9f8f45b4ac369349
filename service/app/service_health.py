"""How the service does, read from its parts."""

from collections.abc import Iterable

from service.api.load import LoadWatch
from service.live.live_view import LiveView
from service.measuring.alarms.health import LookAtHealth, ServiceHealth, StreamLook, enough_room
from service.measuring.bus import Bus
from service.measuring.recorder import Recorder
from service.measuring.soundness import Soundness
from service.recordings.capture.captures import Captures
from service.recordings.continuous.tape import Tape
from service.recordings.keeping.keeper import WaveformKeeper
from service.runtime.space.watch import SpaceWatch


def health_of(
    units: Iterable[str],
    live: LiveView,
    recorder: Recorder,
    captures: Captures,
    bus: Bus,
    space: SpaceWatch | None = None,
    load: LoadWatch | None = None,
    tape: Tape | None = None,
    recordings: WaveformKeeper | None = None,
    soundness: Soundness | None = None,
    stream: StreamLook | None = None,
) -> LookAtHealth:
    """A look at the parts of the running service."""
    names = list(units)

    def look() -> ServiceHealth:
        return ServiceHealth(
            store_error=live.store_error,
            store_behind_s=recorder.behind_s,
            n_unstored=live.n_unstored,
            unstored_reason=live.unstored_reason,
            waiting_share=bus.depth / bus.capacity,
            analysis_delay_s=max(bus.oldest_wait_s, stream.behind_s() if stream else 0.0),
            captures_error=captures.trouble,
            recording_error=recording_error(tape, recordings),
            n_recordings_damaged=recordings.n_lost if recordings else 0,
            refused=load.words if load else None,
            stored_trouble=soundness.trouble if soundness else None,
            stream_trouble=stream.trouble() if stream else None,
            accounts={
                unit: status.account
                for unit in names
                if (status := live.status(unit)).last_sample_ns is not None
            },
            disk=enough_room if space is None else space.condition,
        )

    return look


def recording_error(tape: Tape | None, recordings: WaveformKeeper | None) -> str | None:
    """Why not all samples are recorded, or recordings not looked after; None if all is well."""
    now = tape.trouble if tape else None
    return now or (recordings.lasting_trouble if recordings else None)
