"""`Delivery`: the last stage of every adapter, from raw blocks to sample blocks."""

from collections.abc import Sequence
from dataclasses import replace

from acquisition.delivery.arrival import Arrival, ArrivalModel
from acquisition.delivery.block_grid import BlockGrid
from acquisition.delivery.calibration import UnitCalibration, calibrate
from acquisition.delivery.raw import RawBlock
from acquisition.delivery.stamps import StampCheck
from core.samples.blocks import SampleBlock
from core.samples.device_clock import DeviceClock, StampFault
from core.units import ns_from_s


class Delivery:
    """Checks stamps, brings blocks onto their grid and calibrates them.

    An adapter keeps one for as long as it lives, across connections: an unfinished block may be
    finished by the next one.

    Parameters
    ----------
    stamped
        Whether ``start_ns`` of the raw blocks comes from the device rather than from the host.
    samples_when_asked
        Whether the host says when to sample: then the device has no rate that could drift.
    """

    def __init__(
        self,
        calibration: UnitCalibration,
        *,
        stamped: bool = True,
        samples_when_asked: bool = False,
    ) -> None:
        self._calibration = calibration
        self._stamped = stamped
        self._samples_when_asked = samples_when_asked
        self._grid = BlockGrid(calibration.block_samples)
        self._stamps = StampCheck()
        self._arrivals = ArrivalModel(calibration.rate_hz)
        self._fault: StampFault | None = None

    def note_fault(self, fault: StampFault) -> None:
        """Let the next block tell that a stamp beside those of its samples was not used."""
        self._stamps.n_faults += 1
        self._fault = fault

    def take(
        self,
        raw: RawBlock,
        arrived: Arrival | None = None,
        held_s: float = 0.0,
        *,
        has_stamp: bool = True,
    ) -> list[SampleBlock]:
        """Take the next raw block; return the sample blocks that it completes.

        Parameters
        ----------
        arrived
            When its last sample had arrived; None where nothing arrives, as from a recording, and
            the device's clock is not to be judged.
        held_s
            For how long the device had had that sample by then.
        has_stamp
            Whether this block has one of the device's stamps, if the device stamps at all.
        """
        raw, own_fault = self._stamps.check(raw)
        blocks = self._grid.put(raw)
        fault = own_fault or self._fault
        if blocks:
            self._fault = None
        if arrived is None:
            return [self._sample_block(block, fault) for block in blocks]
        self._note_arrival(raw, has_stamp and own_fault is None, arrived)
        clock = self._reading()
        sampled_s = arrived.steady_s - held_s
        return [
            replace(self._sample_block(block, fault), clock=clock, sampled_s=sampled_s)
            for block in blocks
        ]

    def take_together(
        self, raws: Sequence[RawBlock], arrived: Arrival, read_for_s: float = 0.0
    ) -> list[SampleBlock]:
        """Take raw blocks that have come together: the device had had all but the last for longer.

        Parameters
        ----------
        read_for_s
            How long it took to read them, since the device said which is the newest.
        """
        blocks: list[SampleBlock] = []
        n_after = sum(raw.n_samples for raw in raws)
        for raw in raws:
            n_after -= raw.n_samples
            blocks += self.take(raw, arrived, read_for_s + n_after / raw.rate_hz)
        return blocks

    def flush(self) -> list[SampleBlock]:
        """What is left when nothing will follow, as at the end of a recording."""
        return [calibrate(raw, self._calibration) for raw in self._grid.flush()]

    def _reading(self) -> DeviceClock:
        clock = self._arrivals.device_clock(self._stamps.n_faults)
        if self._samples_when_asked:
            return replace(clock, drift_ppm=None, u_drift_ppm=None)
        return clock

    def _note_arrival(self, raw: RawBlock, is_good: bool, arrived: Arrival) -> None:
        stop_ns = raw.start_ns + ns_from_s(raw.n_samples / raw.rate_hz)
        own_stamp = self._stamped and is_good
        self._arrivals.add(raw.epoch, raw.stop_index, stop_ns if own_stamp else None, arrived)

    def _sample_block(self, raw: RawBlock, fault: StampFault | None) -> SampleBlock:
        block = calibrate(raw, self._calibration)
        return block if fault is None else replace(block, stamp_fault=fault)
