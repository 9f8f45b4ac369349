"""A device of polled registers that lives on a stepped clock."""

import numpy as np

from acquisition.modbus.cells import Cell, NumberType
from acquisition.modbus.polled_source import PolledSource
from acquisition.modbus.register_map import FlagCheck, MapValue, Meaning, RegisterMap
from acquisition.simulated.devices.map_device import MapDevice
from core.samples.blocks import SampleBlock
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from rigs.blocks import cell_block

STATUS = Cell(address=50)
BAD_IF_SET = FlagCheck(cell=STATUS, mask=0x0008, set_means=Meaning.BAD)
CHANNEL = ChannelCalibration(10.0, 100.0, -10.0, 10.0)
CALIBRATION = UnitCalibration(
    "U1", 1.0, (CHANNEL,), (SlowCalibration("oil", -50.0, 200.0),), block_samples=1
)


class Waves:
    """A converter of one channel of counts: 100 engineering units at sample 0, then 101 and on."""

    def __init__(self) -> None:
        self.n, self.value, self.oil = 0, 100.0, 45.0

    def advance(self, n_samples: int) -> SampleBlock:
        first, self.n = self.n, self.n + n_samples
        counts = np.full((1, n_samples), self.value + first, dtype=np.float32)
        start_ns = (1_800_000_000 + first) * 10**9
        return cell_block(0, first, start_ns, 1.0, counts, (True,), (self.oil,))


def map_of(**settings) -> RegisterMap:
    wave_cell = Cell(address=10, type=NumberType.FLOAT32)
    wave = MapValue(id="wave", cell=wave_cell, flags=(BAD_IF_SET,))
    oil = MapValue(
        id="oil",
        cell=Cell(address=20, type=NumberType.INT16),
        scale=0.1,
        invalid_values=(0x8000,),
        flags=(BAD_IF_SET,),
    )
    return RegisterMap(**({"values": (wave, oil)} | settings))


def device_of(registers: RegisterMap) -> MapDevice:
    return MapDevice(Waves(), registers, ("wave",), CALIBRATION)


class Follower:
    """A clock on which a device lives: it produces whenever time passes."""

    def __init__(self, clock, device: MapDevice) -> None:
        self._clock, self._device, self._done = clock, device, 0

    def now_ns(self) -> int:
        return self._clock.now_ns()

    def monotonic_s(self) -> float:
        return self._clock.monotonic_s()

    async def sleep(self, duration_s: float) -> None:
        await self._clock.sleep(duration_s)
        self.catch_up()

    def step(self, duration_s: float) -> None:
        self._clock.step(duration_s)
        self.catch_up()

    def catch_up(self) -> None:
        passed = int(self._clock.monotonic_s() + 1e-6)
        self._device.produce(passed - self._done)
        self._done = passed


async def take(source: PolledSource, n: int) -> list[SampleBlock]:
    async with source.connect() as stream:
        return [await anext(stream) for _ in range(n)]
