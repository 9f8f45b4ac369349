"""`VectorMonitor`: what a rack has measured in, assessments of the unit's bearings out."""

from collections import deque
from collections.abc import Iterator, Sequence

from core.condition.shaft_readings import measured_growth
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import Assessment, AveragingWindow
from core.monitor.monitor import JUDGED
from core.monitor.monitor_state import MonitorState
from core.monitor.monitored_unit import MonitoredUnit
from core.monitor.settings import AnalysisSettings
from core.monitor.vector_results import VectorResults
from core.quality import worst
from core.samples.blocks import SampleBlock
from core.samples.ring import Ring
from core.spectra.cross_spectrum import NO_SPECTRUM
from core.spectra.runout import RunoutVerdict, runout_verdict
from core.spectra.vector_polls import Poll, PollReader
from core.spectra.vector_rows import VectorRow
from core.spectra.vector_settings import VectorSettings


class VectorMonitor(MonitoredUnit):
    """Watches a unit by the vectors of its rack. All state of its analysis is here.

    Results depend on the polls and their indices alone, not on how they were cut into blocks.

    Parameters
    ----------
    unit
        Its rate is that of the polls.
    rows
        What the rows of a block are.
    settings
        What counts as evidence; segments play no part here.
    averaging
        Which polls make a result.

    Raises
    ------
    ValueError
        If a row is of a channel that the unit has not.
    """

    def __init__(
        self,
        unit: Unit,
        rows: Sequence[VectorRow],
        settings: AnalysisSettings,
        averaging: VectorSettings | None = None,
    ) -> None:
        # the ring is for the index rules and the account; polls are kept here
        super().__init__(unit, Ring(len(rows), 1))
        self._settings = settings
        self._averaging = averaging or VectorSettings()
        self._reader = PollReader(unit, rows, settings)
        self._polls: deque[Poll] = deque()
        self._first_index: int | None = None
        self._n_hops = -1

    @property
    def state(self) -> MonitorState:
        """What must be known beside its newest polls to go on from here elsewhere."""
        start = self._polls[0].index if self._polls else self._ring.stop_index
        first_index = self._first_index or 0
        account = self._ring.account
        return MonitorState(self._ring.epoch, start, first_index, 0, dict(self._growth), account)

    def rewind(self, state: MonitorState) -> None:
        """Expect the polls since `state.start` once more: any may be the first of them."""

    def settle(self, state: MonitorState) -> None:
        """Be as the one was that `state` is of, after these polls."""
        super().settle(state)
        self._first_index = state.first_start

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take rows in, a sample for each poll, and hand over what is learnt, one bearing each."""
        self.require(block)
        epoch, taken_up_to = self._ring.epoch, self._ring.stop_index
        self._write_to_ring(block)
        if block.epoch != epoch:
            self._begin(block.first_index)
            taken_up_to = 0
        for poll in self._reader.polls(block):
            if poll.index >= taken_up_to:
                yield from self._take(block.epoch, poll)

    def _begin(self, first_index: int) -> None:
        self._polls.clear()
        self._first_index = first_index
        self._n_hops = first_index // self._averaging.hop_polls

    def _take(self, epoch: int, poll: Poll) -> Iterator[Assessment]:
        self._polls.append(poll)
        while self._polls[0].index <= poll.index - self._averaging.n_polls:
            self._polls.popleft()
        n_hops = (poll.index + 1) // self._averaging.hop_polls
        if n_hops != self._n_hops:
            self._n_hops = n_hops
            for bearing in self.unit.bearings:
                yield self._assess(epoch, bearing)

    def _assess(self, epoch: int, bearing: Bearing) -> Assessment:
        polls = list(self._polls)
        newest = polls[-1]
        n_possible = newest.index + 1 - (self._first_index or 0)
        results = VectorResults(
            self.unit,
            bearing,
            self._settings,
            self._averaging,
            polls,
            min(self._averaging.n_polls, n_possible),
            self._growth.get(bearing.id),
        )
        growth = measured_growth(results.readings)
        if growth is not None:
            self._growth[bearing.id] = growth
        stop_index = newest.index + 1
        return Assessment(
            unit=self.unit.id,
            bearing=bearing.id,
            time_ns=newest.time_ns,
            window=AveragingWindow(
                epoch=epoch,
                first_index=polls[0].index,
                stop_index=stop_index,
                n_segments=results.n_polls,
                n_segments_wanted=self._averaging.n_polls,
                n_voided=0,
                coverage=results.coverage,
                duration_s=(stop_index - polls[0].index) / self.unit.rate_hz,
            ),
            speed_source=newest.speed.source,
            quality=worst(r.quality for name, r in results.readings.items() if name in JUDGED),
            readings=results.readings,
            budgets=results.budgets,
            estimators=results.estimators,
            spectrum=NO_SPECTRUM,
            orbit=None,
            runout={
                "shaft_x": self._runout(bearing.shaft_x),
                "shaft_y": self._runout(bearing.shaft_y),
            },
            evidence=results.evidence,
            recent=results.recent,
        )

    def _runout(self, id_: str) -> RunoutVerdict:
        """A rack's phase has another reference than a slow-roll vector of padwatch's."""
        channel = next(channel for channel in self.unit.channels if channel.id == id_)
        return runout_verdict(
            channel.slow_roll, channel.probe, self.unit.rated_speed_rpm, has_key_phase=False
        )
