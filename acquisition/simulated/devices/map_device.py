"""`MapDevice`: a simulated device whose registers show the newest sample of a feed."""

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.delivery.calibration import UnitCalibration
from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.modbus.read_plan import plan_reads
from acquisition.modbus.register_map import MapValue, RegisterMap
from acquisition.simulated.devices.register_image import RegisterImage, no_value
from acquisition.simulated.feed import Ledger, RawFeed, SlotFeed
from core.arrays import FloatArray

_BEAT_MODULUS = 65536
_LAST_LOOKS = 2


class MapDevice:
    """One unit's device, of which everything is read from registers.

    Parameters
    ----------
    feed
        Where the samples come from.
    registers
        Its map, written by the ids of `rows` and of the calibration's slow channels; what else the
        map names stays zero.
    rows
        Id of the value that each channel of the feed becomes.
    calibration
        Turns the feed's counts into the channels' units.
    step_samples
        Samples that pass before the registers change; they show the last of them.

    Attributes
    ----------
    image
        The registers.
    newest
        What was written last.
    frozen
        While set, the device answers but its data stand still.
    on_demand
        Whether time passes only when a reader begins to read the map again.
    """

    def __init__(
        self,
        feed: RawFeed,
        registers: RegisterMap,
        rows: Sequence[str],
        calibration: UnitCalibration,
        unit: str = "U1",
        step_samples: int = 1,
        ledger: Ledger | None = None,
    ) -> None:
        self._feed = SlotFeed(feed, step_samples)
        self._map, self._rows, self._calibration = registers, rows, calibration
        self._unit, self._step_samples = unit, step_samples
        self.ledger = ledger or Ledger()
        self.image = RegisterImage(registers)
        self.identification: Mapping[int, bytes] = {}
        self.frozen = self.on_demand = self.ended = False
        self._values = {value.id: value for value in registers.values}
        self._first = next(iter(plan_reads(registers).requests))
        self._spoilt: dict[str, int] = {}
        self._beat = self._n_looks = 0
        first = self._feed.take()
        if first is None:
            raise ConfigError("the feed has nothing to show")
        self._position = self._feed.number(first)
        self._show(first)

    @property
    def step_s(self) -> float:
        """Time from one change of the registers to the next."""
        return self._step_samples / self.newest.rate_hz

    @property
    def drained(self) -> bool:
        """Whether the feed has ended and a reader has seen the last of it."""
        return self.ended and self._n_looks >= _LAST_LOOKS

    def produce(self, n_steps: int = 1) -> None:
        """Let so much time pass; nobody sees what is overwritten."""
        for _ in range(n_steps):
            if self.frozen or self._spend("freeze"):
                continue
            ahead = self._feed.peek()
            if ahead is None:
                self.ended = True
                return
            self._position += 1
            if ahead.epoch != self.newest.epoch or self._feed.number(ahead) <= self._position:
                self._position = self._feed.number(ahead)
                self._show(ahead)
                self._feed.take()

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        """Answer functions 3 and 4."""
        self._look(function, address)
        return self.image.read_registers(function, address, count)

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:
        """Answer functions 1 and 2."""
        self._look(function, address)
        return self.image.read_bits(function, address, count)

    def read_fifo(self, address: int) -> bytes | None:  # noqa: ARG002
        """There is no queue."""
        return None

    def fault_names(self) -> list[str]:
        """What can happen to the next values."""
        return ["freeze", "sentinel", "flag"]

    def spoil(self, fault: str, count: int) -> None:
        """Let one of these happen so many steps long, to all values.

        A sentinel is the device's own number for an error, a flag its word for a bad value.
        """
        self._spoilt[fault] = self._spoilt.get(fault, 0) + count

    def _look(self, function: int, address: int) -> None:
        if (function, address) != (self._first.function, self._first.start):
            return
        self._n_looks += self.ended
        if self.on_demand:
            self.produce()

    def _spend(self, fault: str) -> bool:
        left = self._spoilt.get(fault, 0)
        self._spoilt[fault] = max(left - 1, 0)
        return left > 0

    def _show(self, raw: RawBlock) -> None:
        self.newest = raw
        self.ledger.offer(self._unit, raw.epoch, raw.n_samples)
        is_error, is_flagged = self._spend("sentinel"), self._spend("flag")
        numbers = self._numbers(raw, in_units(raw, self._calibration))
        for id_, (number, good) in numbers.items():
            value = self._values.get(id_)
            if value is not None:
                self._write(value, number, good and not is_flagged, is_error)
        self._beat = (self._beat + 1) % _BEAT_MODULUS
        if self._map.heartbeat is not None:
            self.image.put(self._map.heartbeat, self._beat)
        self.image.put_time(raw.start_ns)

    def _numbers(self, raw: RawBlock, units: FloatArray) -> dict[str, tuple[float, bool]]:
        """Number and goodness of every value that the device shows."""
        channels = {
            row: (float(samples[-1]), ok)
            for row, samples, ok in zip(self._rows, units, raw.ok, strict=True)
        }
        slow = {c.id: (v, True) for c, v in zip(self._calibration.slow, raw.slow, strict=True)}
        return channels | slow

    def _write(self, value: MapValue, number: float, good: bool, is_error: bool) -> None:
        self.image.put_value(value, number)
        if is_error:
            self.image.put(value.cell, no_value(value))
        for flag in value.flags:
            self.image.put_flag(flag, good)


def in_units(raw: RawBlock, calibration: UnitCalibration) -> FloatArray:
    """Samples of a raw block in engineering units, (n_channels, n_samples)."""
    if raw.counts.dtype == np.float32:
        return raw.counts.astype(np.float64)
    gain = np.array([channel.unit_per_count for channel in calibration.channels])
    units: FloatArray = raw.counts * gain[:, np.newaxis]
    return units
