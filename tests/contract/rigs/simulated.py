"""The simulated source on a counting plant."""

from acquisition.simulated.source import SimulatedSource
from acquisition.source import SampleSource


class SimulatedRig:
    """A simulated source in real time, on a clock that is stepped."""

    def __init__(self, feed, calibration, clock) -> None:
        self._clock = clock
        self._rate_hz = calibration.rate_hz
        self.step_samples = 50
        self.source: SampleSource = SimulatedSource(feed, calibration, clock)

    async def __aenter__(self) -> "SimulatedRig":
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    def run(self, n_samples: int) -> None:
        self._clock.step(n_samples / self._rate_hz)
