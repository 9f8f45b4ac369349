"""`Delivery`: the last stage of every adapter, from raw blocks to sample blocks."""

from dataclasses import replace

from acquisition.arrival import Arrival
from acquisition.block_grid import BlockGrid
from acquisition.calibration import UnitCalibration, calibrate
from acquisition.clock_estimate import ClockEstimate
from acquisition.raw import RawBlock
from acquisition.stamps import StampCheck
from core.blocks import SampleBlock
from core.device_clock import StampFault
from core.units import ns_from_s


class Delivery:
    """Checks stamps, brings blocks onto their grid and calibrates them.

    An adapter keeps one for as long as it lives, across connections: an unfinished block may be
    finished by the next one.

    Parameters
    ----------
    stamped
        Whether ``start_ns`` of the raw blocks comes from the device rather than from the host.
    """

    def __init__(self, calibration: UnitCalibration, *, stamped: bool = True) -> None:
        self._calibration = calibration
        self._stamped = stamped
        self._grid = BlockGrid(calibration.block_samples)
        self._stamps = StampCheck()
        self._clock = ClockEstimate()

    def take(self, raw: RawBlock, arrived: Arrival | None = None) -> list[SampleBlock]:
        """Take the next raw block; return the sample blocks that it completes.

        Parameters
        ----------
        arrived
            When its last sample had arrived; None where nothing arrives, as from a recording, and
            the device's clock is not to be judged.
        """
        raw, fault = self._stamps.check(raw)
        if arrived is not None:
            self._note_arrival(raw, fault, arrived)
        return [self._sample_block(r, fault, arrived) for r in self._grid.put(raw)]

    def flush(self) -> list[SampleBlock]:
        """What is left when nothing will follow, as at the end of a recording."""
        return [calibrate(raw, self._calibration) for raw in self._grid.flush()]

    def _note_arrival(self, raw: RawBlock, fault: StampFault | None, arrived: Arrival) -> None:
        stop_ns = raw.start_ns + ns_from_s(raw.n_samples / raw.rate_hz)
        own_stamp = self._stamped and fault is None
        self._clock.add(
            raw.epoch,
            raw.stop_index,
            raw.rate_hz,
            stop_ns if own_stamp else None,
            arrived,
        )

    def _sample_block(
        self, raw: RawBlock, fault: StampFault | None, arrived: Arrival | None
    ) -> SampleBlock:
        block = calibrate(raw, self._calibration)
        if arrived is None and fault is None:
            return block
        clock = None if arrived is None else self._clock.reading(self._stamps.n_faults)
        return replace(block, clock=clock, stamp_fault=fault)
