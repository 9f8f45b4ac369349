"""`VectorDevice`: a simulated rack that makes vectors of its channels' samples."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.raw import RawBlock
from acquisition.modbus.register_map import RegisterMap
from acquisition.simulated.devices.map_device import MapDevice, in_units
from acquisition.simulated.feed import Ledger, RawFeed
from core.arrays import FloatArray
from core.spectra.lines import exact_phasors, tapered
from core.spectra.vector_rows import VectorPart, VectorRow
from core.units import hz_from_rpm


class VectorDevice(MapDevice):
    """One unit's rack: amplitudes and phases by a transform over the newest samples.

    Its phases count from a mark that passes at sample number 0 of the feed, if the speed stays.

    Parameters
    ----------
    channels
        Ids of the feed's channels, in their order.
    rows
        What the rack gives; must be in the map.
    speed_channel
        Slow channel of the running speed in r/min; its line is looked at.
    window_samples
        Samples that are transformed: a multiple of `step_samples`, some turns long.
    vortex_order
        Where the other line is, in multiples of the speed.
    """

    def __init__(
        self,
        feed: RawFeed,
        registers: RegisterMap,
        rows: Sequence[VectorRow],
        calibration: UnitCalibration,
        *,
        channels: Sequence[str],
        speed_channel: str,
        unit: str = "U1",
        step_samples: int = 600,
        window_samples: int = 6000,
        vortex_order: float = 0.25,
        ledger: Ledger | None = None,
    ) -> None:
        self._vector_rows, self._vortex_order = rows, vortex_order
        self._channel = {id_: n for n, id_ in enumerate(channels)}
        self._speed = [slow.id for slow in calibration.slow].index(speed_channel)
        self._window: deque[RawBlock] = deque(maxlen=window_samples // step_samples)
        super().__init__(feed, registers, (), calibration, unit, step_samples, ledger)

    def _numbers(self, raw: RawBlock, units: FloatArray) -> dict[str, tuple[float, bool]]:  # noqa: ARG002
        if self._window and (self._window[-1].epoch, self._window[-1].stop_index) != (
            raw.epoch,
            raw.first_index,
        ):
            self._window.clear()
        self._window.append(raw)
        samples = np.concatenate([in_units(r, self._calibration) for r in self._window], axis=1)
        found = self._parts(samples, self._window[0].first_index, raw.slow[self._speed])
        ok = np.all([r.ok for r in self._window], axis=0)
        vectors = {
            row.id: (float(found[row.part][n]), bool(ok[n]))
            for row in self._vector_rows
            for n in [self._channel[row.channel]]
        }
        slow = {c.id: (v, True) for c, v in zip(self._calibration.slow, raw.slow, strict=True)}
        return vectors | slow

    def _parts(
        self, samples: FloatArray, first_index: int, speed_rpm: float
    ) -> dict[VectorPart, FloatArray]:
        """(n_channels,) of everything a rack may give; no number at standstill."""
        rate_hz, turn_hz = self._calibration.rate_hz, hz_from_rpm(speed_rpm)
        turns = np.full((len(samples), 2), np.nan, dtype=np.complex128)
        if 0.0 < turn_hz < rate_hz / 2.0:
            order_hz = turn_hz * np.array([1.0, self._vortex_order])
            turns = exact_phasors(tapered(samples), rate_hz, order_hz)
            turns *= np.exp(-2j * np.pi * order_hz * first_index / rate_hz)
        return {
            VectorPart.ORDER1_AMPLITUDE: np.abs(turns[:, 0]),
            VectorPart.ORDER1_PHASE: np.rad2deg(np.angle(turns[:, 0])),
            VectorPart.VORTEX_AMPLITUDE: np.abs(turns[:, 1]),
            VectorPart.OVERALL: np.ptp(samples, axis=1) / 2.0,
            VectorPart.GAP: samples.mean(axis=1),
        }
