"""Sources on a clock that is stepped: a recording of a counting plant, and the simulated source."""

import tempfile
from dataclasses import replace
from pathlib import Path

from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource
from acquisition.recordings.writer import RecordingWriter
from acquisition.simulated.feed import SimulatedSource
from acquisition.source import SampleSource
from core.machine.channel import Measurand


class RecordingRig:
    """A recording replayed at its own pace, on a clock that is stepped."""

    def __init__(self, feed, calibration, clock) -> None:
        self._feed, self._calibration, self._clock = feed, calibration, clock
        self._parent = tempfile.TemporaryDirectory()
        self.step_samples = 50
        self.source: SampleSource

    sample_type = "int16"

    async def __aenter__(self) -> "RecordingRig":
        folder = Path(self._parent.name) / "recording"
        unit = recorded(self._calibration).model_copy(update={"sample_type": self.sample_type})
        with RecordingWriter(folder, unit, "contract suite") as writer:
            for _ in range(400):
                raw = self._feed.advance(self.step_samples)
                writer.write(replace(raw, counts=raw.counts.astype(self.sample_type)))
        self.source = RecordingSource(open_recording(folder), self._clock, speed=1.0)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._parent.cleanup()

    def run(self, n_samples: int) -> None:
        self._clock.step(n_samples / self._calibration.rate_hz)


class UnitsRecordingRig(RecordingRig):
    """The same in engineering units, as from a device that has no counts."""

    sample_type = "float32"


class SimulatedRig(RecordingRig):
    """A simulated source in real time."""

    async def __aenter__(self) -> "SimulatedRig":
        self.source = SimulatedSource(self._feed, self._calibration, self._clock)
        return self


def recorded(calibration) -> RecordedUnit:
    """Names for the channels of a calibration."""
    return RecordedUnit(
        unit=calibration.unit,
        rate_hz=calibration.rate_hz,
        channels=tuple(
            RecordedChannel(id=f"channel{n}", measurand=Measurand.GAP_UM, **vars(channel))
            for n, channel in enumerate(calibration.channels)
        ),
        slow_channels=tuple(
            RecordedSlowChannel(unit="degC", **vars(slow)) for slow in calibration.slow
        ),
    )
