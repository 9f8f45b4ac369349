"""A simulated rack says of a known machine what a real one would, and equation (5) follows."""

from pathlib import Path

import numpy as np
import pytest
from rigs.blocks import cell_block

from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.polled_source import PolledSettings, PolledSource, vector_calibration
from acquisition.modbus.transport import TcpTransport
from acquisition.simulated.devices.map_device import VectorDevice
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.spectra.polls import PollSettings, PollTransform, VectorPart, VectorRow
from service.settings.sources.register_map import load_map_file

RACK = Path(__file__).parents[4] / "deploy" / "maps" / "vector-rack-skf-like.toml"
RATE_HZ, SPEED_RPM, K_B = 600.0, 92.3, 1.18e9
IDS = ("ujb_shaft_x", "ujb_shaft_y", "ujb_bearing_x", "ujb_bearing_y")
OMEGA = 2 * np.pi * SPEED_RPM / 60


class Machine:
    """Shaft 60 and 50 µm, bearing 20 and 16 µm as velocity in mm/s, gaps 1970 and 2020 µm."""

    def __init__(self) -> None:
        self._n = 0

    def advance(self, n_samples: int) -> SampleBlock:
        first, self._n = self._n, self._n + n_samples
        turn = OMEGA * np.arange(first, self._n) / RATE_HZ
        samples = np.array(
            [
                1970 + 60 * np.cos(turn),
                2020 + 50 * np.sin(turn),
                20e-3 * OMEGA * np.cos(turn + 1.0),
                16e-3 * OMEGA * np.cos(turn),
            ],
            dtype=np.float32,
        )
        scatter = np.random.default_rng(first).normal(size=samples.shape).astype(np.float32)
        samples *= 1 + 1e-3 * scatter
        return cell_block(0, first, 10**18, RATE_HZ, samples, (True,) * 4, (SPEED_RPM,))


def rows_of(path: Path) -> tuple[VectorRow, ...]:
    values = load_map_file(path).value
    return tuple(
        VectorRow(v.channel, v.quantity) for v in values if isinstance(v.quantity, VectorPart)
    )


@pytest.fixture
def calibration() -> UnitCalibration:
    probe = ChannelCalibration(24.0, 250.0, 1.0, 20.0)
    velocity = ChannelCalibration(10.0, 10.0, -5.0, 5.0)
    speed = SlowCalibration("speed", 0.0, 200.0)
    return UnitCalibration("U1", RATE_HZ, (probe, probe, velocity, velocity), (speed,))


@pytest.fixture
def rack(calibration) -> VectorDevice:
    registers = load_map_file(RACK).register_map()
    device = VectorDevice(
        Machine(), registers, rows_of(RACK), calibration, channels=IDS, speed_channel="speed"
    )
    device.produce(10)
    return device


def test_a_rack_states_amplitudes_phases_and_gaps_in_its_own_conventions(rack):
    decoder = MapDecoder(load_map_file(RACK).register_map())
    content = b"".join(
        rack.image.read_registers(r.function, r.address, r.count) for r in decoder.plan.spans
    )
    found = dict(zip(decoder.map.ids, decoder.read(content).values, strict=True))

    assert found["ujb_shaft_x.order1_amplitude"] == pytest.approx(60.0, rel=2e-3)
    assert found["ujb_shaft_x.order1_phase"] == pytest.approx(0.0, abs=0.5)
    assert found["ujb_shaft_y.order1_phase"] == pytest.approx(-90.0, abs=0.5)
    assert found["ujb_bearing_x.order1_amplitude"] == pytest.approx(20e-3 * OMEGA, abs=1e-3)
    assert found["ujb_shaft_x.gap"] == pytest.approx(1970.0, abs=5.0)
    assert found["speed"] == pytest.approx(92.3, abs=0.05)


async def test_equation_5_comes_out_of_a_rack_over_the_wire(rack, calibration, stepped_clock):
    rows, rate_hz = rows_of(RACK), 1.0
    rack.on_demand = True
    channels = tuple(
        Channel(id_, m, 1)
        for id_, m in zip(IDS, [Measurand.GAP_UM] * 2 + [Measurand.VELOCITY_MM_S] * 2, strict=True)
    )
    bearing = Bearing("UJB", K_B, *IDS, 200.0, (2000.0, 2000.0))
    unit = Unit("U1", SPEED_RPM, rate_hz, channels, (bearing,), "speed")
    settings = AnalysisSettings()
    transform = PollTransform(unit, rows, settings, PollSettings(24, 12, 4))
    monitor = UnitMonitor(unit, settings, transform)
    async with ModbusTcpServer(rack) as server:
        transport = TcpTransport(host="127.0.0.1", port=server.port)
        source = PolledSource(
            PolledSettings(transport=transport, timeout_s=5.0),
            load_map_file(RACK).register_map(),
            [row.id for row in rows],
            vector_calibration(calibration, IDS, rows),
            stepped_clock,
        )
        found = []
        async with source.connect() as stream:
            while not found:
                found = list(monitor.steps(await anext(stream)))

    [assessment] = found
    value = {name: reading.value for name, reading in assessment.readings.items()}
    assert value["order1_k_eff_xx_n_per_m"] == pytest.approx(20 / 60 * K_B, rel=0.01)
    assert value["order1_k_eff_yy_n_per_m"] == pytest.approx(16 / 50 * K_B, rel=0.01)
    assert value["shaft_centre_x_um"] == pytest.approx(30.0, abs=5.0)
    assert value["speed_rpm"] == pytest.approx(92.3, abs=0.05)
    assert assessment.evidence == "amplitude_only"
