"""Simulated Modbus devices with registers of the newest samples, or of amplitudes and phases."""

from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from acquisition.errors import ConfigError
from acquisition.modbus.read_plan import plan_reads
from acquisition.modbus.register_map import MapValue, RegisterMap
from acquisition.simulated.devices.modbus_device import ModbusDevice
from acquisition.simulated.devices.register_image import RegisterImage, no_value
from acquisition.simulated.feed import Ledger, SampleFeed
from core.arrays import FloatArray
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration
from core.spectra.lines import part_phasors, turning_factors
from core.spectra.polls import VectorPart, VectorRow
from core.units import hz_from_rpm

_BEAT_MODULUS = 65536
_SENTINEL, _FLAG = "sentinel", "flag"


class MapDevice(ModbusDevice):
    """Simulated Modbus device of one unit with the newest sample of each channel in registers.

    `ledger` counts the produced samples, by default in a new `Ledger`, for the unit named `unit`.

    Parameters
    ----------
    registers
        Register map. The device writes the values with an id in `rows`, or with the id of a slow
        channel of the calibration; all other values remain zero.
    rows
        Ids of the map values of the channels, in the channel order of the feed.
    calibration
        Calibration that converts the counts of the feed to engineering units.
    step_samples
        Number of samples between two updates of the registers; an update writes the last one.

    Attributes
    ----------
    image
        Contents of the registers.
    newest
        Block of `step_samples` samples of the last update.

    Raises
    ------
    ConfigError
        If the feed has no run of `step_samples` samples without a gap.
    """

    def __init__(
        self,
        feed: SampleFeed,
        registers: RegisterMap,
        rows: Sequence[str],
        calibration: UnitCalibration,
        unit: str = "U1",
        step_samples: int = 1,
        ledger: Ledger | None = None,
    ) -> None:
        super().__init__(feed, step_samples, unit, ledger)
        self._map, self._rows, self._calibration = registers, rows, calibration
        self._step_samples = step_samples
        self.image = RegisterImage(registers)
        self._values = {value.id: value for value in registers.values}
        self._first = next(iter(plan_reads(registers).spans))
        self._spoilt: Counter[str] = Counter()
        self._beat = 0
        if self._feed.peek() is None:
            raise ConfigError(
                f"simulated Modbus device: the feed has no {step_samples} samples without a gap"
            )
        self._take()

    @property
    def step_s(self) -> float:
        """Time between two updates of the registers in seconds."""
        return self._step_samples / self.newest.rate_hz

    @property
    def faults(self) -> Mapping[str, Callable[[int], None]]:
        """Fault injectors by name, called with a count: frozen data, bad numbers, bad status."""
        spoils = {name: partial(self._spoil_values, name) for name in (_SENTINEL, _FLAG)}
        return {**super().faults, **spoils}

    def read_registers(self, function: int, address: int, count: int) -> bytes | None:
        """Return `count` registers as big-endian words; None if an address does not exist."""
        self._look(function, address)
        return self.image.read_registers(function, address, count)

    def read_bits(self, function: int, address: int, count: int) -> bytes | None:
        """Return `count` bits packed in bytes, low bit first; None if an address does not exist."""
        self._look(function, address)
        return self.image.read_bits(function, address, count)

    def _look(self, function: int, address: int) -> None:
        if (function, address) != (self._first.function, self._first.address):
            return
        self._n_looks += self.ended
        if self.on_demand:
            self.produce()

    def _spoil_values(self, fault: str, count: int) -> None:
        self._spoilt[fault] += count

    def _show(self, raw: SampleBlock) -> None:
        self.newest = raw
        self.ledger.offer(self._unit, raw.epoch, raw.n_samples)
        self._spoilt, spoilt = self._spoilt - Counter((_SENTINEL, _FLAG)), self._spoilt
        numbers = self._numbers(raw, _in_units(raw, self._calibration))
        for id_, (number, good) in numbers.items():
            value = self._values.get(id_)
            if value is not None:
                self._write(value, number, good and not spoilt[_FLAG], bool(spoilt[_SENTINEL]))
        self._beat = (self._beat + 1) % _BEAT_MODULUS
        if self._map.heartbeat is not None:
            self.image.put(self._map.heartbeat, self._beat)
        self.image.put_time(raw.start_ns)

    def _numbers(self, raw: SampleBlock, units: FloatArray) -> dict[str, tuple[float, bool]]:
        """Return the number in engineering units, and whether its channel is OK, by value id."""
        channels = {
            row: (float(samples[-1]), ok)
            for row, samples, ok in zip(self._rows, units, raw.side.ok[:, 0].tolist(), strict=True)
        }
        return channels | self._slow_numbers(raw)

    def _slow_numbers(self, raw: SampleBlock) -> dict[str, tuple[float, bool]]:
        numbers = raw.side.slow[:, 0].tolist()
        return {c.id: (n, True) for c, n in zip(self._calibration.slow, numbers, strict=True)}

    def _write(self, value: MapValue, number: float, good: bool, is_error: bool) -> None:
        self.image.put_value(value, number)
        if is_error:
            self.image.put(value.cell, no_value(value))
        for flag in value.flags:
            self.image.put_flag(flag, good)


def _in_units(raw: SampleBlock, calibration: UnitCalibration) -> FloatArray:
    """Return the samples of a block in engineering units, (n_channels, n_samples), as float64.

    Samples that are float32 are in engineering units already.
    """
    if raw.counts.dtype == np.float32:
        return raw.counts.astype(np.float64)
    gain = np.array([channel.unit_per_count for channel in calibration.channels])
    units: FloatArray = raw.counts * gain[:, np.newaxis]
    return units


class VectorDevice(MapDevice):
    """Simulated monitoring rack of one unit: amplitudes and phases over a window of samples.

    At constant speed, phases refer to a key-phase mark at sample index 0 of the feed. Registers
    are updated every `step_samples` samples, which `ledger` counts for the unit named `unit`.

    Parameters
    ----------
    channels
        Ids of the channels, in the channel order of the feed.
    rows
        Quantities that the rack calculates; their ids must be in the register map.
    speed_channel
        Id of the slow channel of the running speed in r/min, the frequency of the 1× line.
    window_samples
        Number of samples in the window: a multiple of `step_samples`, several turns long.
    vortex_order
        Frequency of the vortex line as a multiple of the running speed.
    """

    def __init__(
        self,
        feed: SampleFeed,
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
        self._window: deque[SampleBlock] = deque(maxlen=window_samples // step_samples)
        super().__init__(feed, registers, (), calibration, unit, step_samples, ledger)

    def _numbers(self, raw: SampleBlock, units: FloatArray) -> dict[str, tuple[float, bool]]:  # noqa: ARG002
        if self._window and (self._window[-1].epoch, self._window[-1].stop_index) != (
            raw.epoch,
            raw.first_index,
        ):
            self._window.clear()
        self._window.append(raw)
        samples = np.concatenate([_in_units(r, self._calibration) for r in self._window], axis=1)
        found = self._parts(
            samples, self._window[0].first_index, float(raw.side.slow[self._speed, 0])
        )
        ok = np.all([r.side.ok[:, 0] for r in self._window], axis=0)
        vectors = {
            row.id: (float(found[row.part][n]), bool(ok[n]))
            for row in self._vector_rows
            for n in [self._channel[row.channel]]
        }
        return vectors | self._slow_numbers(raw)

    def _parts(
        self, samples: FloatArray, first_index: int, speed_rpm: float
    ) -> dict[VectorPart, FloatArray]:
        """Return each quantity of the rack, (n_channels,); spectral lines are NaN at standstill."""
        rate_hz, turn_hz = self._calibration.rate_hz, hz_from_rpm(speed_rpm)
        turns = np.full((len(samples), 2), np.nan, dtype=np.complex128)
        if 0.0 < turn_hz < rate_hz / 2.0:
            order_hz = turn_hz * np.array([1.0, self._vortex_order])
            turning = turning_factors(samples.shape[1], rate_hz, order_hz)
            turns = part_phasors(samples, turning)
            turns *= np.exp(-2j * np.pi * order_hz * first_index / rate_hz)
        return {
            VectorPart.ORDER1_AMPLITUDE: np.abs(turns[:, 0]),
            VectorPart.ORDER1_PHASE: np.rad2deg(np.angle(turns[:, 0])),
            VectorPart.VORTEX_AMPLITUDE: np.abs(turns[:, 1]),
            VectorPart.OVERALL: np.ptp(samples, axis=1) / 2.0,
            VectorPart.GAP: samples.mean(axis=1),
        }
