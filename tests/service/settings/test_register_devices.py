"""A simulated machine says the same by a rack, by queues, over CAN and as waveforms; retries."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.can.settings import CanLinkSettings
from acquisition.can.settings import CanSettings as CanAdapterSettings
from acquisition.can.source import CanSource
from acquisition.delivery.blocks import BlockAssembler
from acquisition.modbus.fifo_source import FifoSettings
from acquisition.modbus.polled_source import PolledSettings
from acquisition.modbus.ring_source import RingSettings
from acquisition.modbus.transport import (
    ExpectedRegisters,
    Identification,
    LinkSettings,
    SerialTransport,
)
from acquisition.simulated.devices.can_shape import daq_dbc
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.app.simulated_daq import modbus_device, modbus_server
from service.measuring.simulated_sources import simulated_feed
from service.measuring.sources import monitor_of, retry_s, source_of
from service.settings.adapter_values import link_settings
from service.settings.can_values import can_daq_of, can_settings_of, can_shape_of
from service.settings.core_values import calibration_of, machine_of
from service.settings.plant import AnalysisModel, load_plant_file
from service.settings.sources.can import CanSettings
from service.settings.sources.devices import (
    MappedDeviceSettings,
    ModbusFifoSettings,
    ModbusPolledSettings,
    ModbusRingSettings,
    ModbusVectorSettings,
)
from service.settings.sources.modbus import (
    IdentificationIdentity,
    ModbusLinkSettings,
    SignatureIdentity,
)
from service.settings.transducers import FOLDER
from service.settings.units import UnitSettings

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
N_SEGMENTS = 6
LINK_FIELDS = {"transport", "keeps_connection"}


@pytest.fixture(scope="module")
def settings() -> UnitSettings:
    return load_plant_file(DEMO).unit[0]


@pytest.fixture
def unit(settings: UnitSettings) -> Unit:
    return machine_of(settings)


def read_by(settings: UnitSettings, plan: Any, **endpoint: Any) -> UnitSettings:
    return settings.model_copy(update={"source": plan.model_copy(update=endpoint)})


def address(n: int) -> dict[str, Any]:
    return {"address": 100 + 2 * n, "type": "float32"}


def vector_map(unit: Unit) -> dict[str, Any]:
    ids = [channel.id for channel in unit.channels]
    values: list[dict[str, Any]] = [
        {"channel": id_, "quantity": "order1_amplitude", "detector": "pp"} for id_ in ids
    ]
    values += [{"channel": id_, "quantity": "order1_phase", "phase": "lag"} for id_ in ids]
    values += [{"channel": id_} for id_ in ("speed", "active_power")]
    return {"value": [value | address(n) for n, value in enumerate(values)]}


@asynccontextmanager
async def served(device) -> AsyncIterator[dict[str, Any]]:
    link = ModbusFifoSettings(kind="modbus_fifo", host="127.0.0.1", port=0, addresses=(0,))
    async with modbus_server(device, link, None, patient=False) as server:
        yield dict(server.endpoint)


def by_waveforms(settings: UnitSettings, unit: Unit, clock) -> Iterator[Assessment]:
    feed, delivery = simulated_feed(settings, clock), BlockAssembler(calibration_of(settings))
    monitor = UnitMonitor(unit, AnalysisSettings())
    for _ in range(8192 * N_SEGMENTS // 600):
        for block in delivery.take([feed.advance(600)]):
            yield from monitor.steps(block)


async def test_a_rack_agrees_with_the_waveforms(settings, unit, stepped_clock):
    expected = {a.bearing: a.readings for a in by_waveforms(settings, unit, stepped_clock)}
    given = {"kind": "modbus_vector", "poll_period_s": 1.0, "map": vector_map(unit)}
    given |= {"n_polls": 60, "hop_polls": 60, "timeout_s": 5.0, "host": "127.0.0.1"}
    plan = ModbusVectorSettings.model_validate(given)
    feed = simulated_feed(settings, stepped_clock)
    device = modbus_device(settings, plan, feed)
    device.produce(12)
    found = {}
    async with served(device) as endpoint:
        source = source_of(read_by(settings, plan, **endpoint), stepped_clock)
        monitor = monitor_of(read_by(settings, plan), AnalysisModel())
        async with source.connect() as stream:
            while not found:
                found = {a.bearing: a.readings for a in monitor.steps(await anext(stream))}

    compared = 0
    for bearing, readings in found.items():
        for name in ("order1_k_eff_xx_n_per_m", "order1_k_eff_yy_n_per_m"):
            one, other = readings[name].value, expected[bearing][name].value
            if one is not None and other is not None:
                assert one == pytest.approx(other, rel=0.05), (bearing, name)
                compared += 1
    assert compared >= 4


async def test_queues_bring_the_very_counts(settings, stepped_clock):
    plan = ModbusFifoSettings(kind="modbus_fifo", host="127.0.0.1", addresses=(7,), timeout_s=5.0)
    feed = simulated_feed(settings, stepped_clock)
    blocks: list[SampleBlock] = []
    async with served(modbus_device(settings, plan, feed)) as endpoint:
        source = source_of(read_by(settings, plan, **endpoint), stepped_clock)
        async with source.connect() as stream:
            while not blocks or blocks[-1].stop_index < 600:
                blocks.append(await anext(stream))

    twin = simulated_feed(settings, stepped_clock)
    for block in blocks:
        np.testing.assert_array_equal(block.counts, twin.advance(block.n_samples).counts)


async def test_polled_registers_show_the_newest_sample(settings, unit, stepped_clock):
    ids = [channel.id for channel in unit.channels]
    values = [{"channel": id_} | address(n) for n, id_ in enumerate(ids)]
    given = {"kind": "modbus_polled", "poll_period_s": 0.01, "host": "127.0.0.1"}
    plan = ModbusPolledSettings.model_validate(given | {"map": {"value": values}})
    clock = stepped_clock
    feed = simulated_feed(settings, clock)
    device = modbus_device(settings, plan, feed)
    async with served(device) as endpoint:
        source = source_of(read_by(settings, plan, **endpoint), clock)
        async with source.connect() as stream:
            block = await anext(stream)

    monitor = monitor_of(read_by(settings, plan), AnalysisModel())
    assert block.rate_hz == monitor.unit.rate_hz == 100.0
    assert block.n_samples == settings.block_samples
    probe = block.samples[[c.id for c in unit.channels].index("ujb_shaft_x")]
    assert 1000.0 < probe.mean() < 3000.0


@pytest.mark.parametrize(("use", "keeps"), [("kept", True), ("per_reply", False)])
def test_how_long_a_connection_is_kept_reaches_the_adapter(use, keeps):
    given = {"kind": "modbus_polled", "host": "192.0.2.1", "poll_period_s": 60.0}
    given |= {"stale_after_s": 600.0, "map": {"value": [{"channel": "a", "address": 1}]}}

    device = ModbusPolledSettings.model_validate(given | {"connection": use})

    assert link_settings(PolledSettings, device).keeps_connection is keeps
    assert link_settings(LinkSettings, device).keeps_connection is keeps


UNIT_COMPUTED = {"channels", "bearings", "slow_channels", "rotation_sense", "has_vortex"}


@pytest.mark.parametrize(
    ("source", "adapter", "computed"),
    [
        (ModbusRingSettings, RingSettings, LINK_FIELDS),
        (ModbusFifoSettings, FifoSettings, LINK_FIELDS),
        (MappedDeviceSettings, PolledSettings, LINK_FIELDS),
        (ModbusLinkSettings, SerialTransport, set()),
        (SignatureIdentity, ExpectedRegisters, set()),
        (IdentificationIdentity, Identification, set()),
        (UnitSettings, Unit, UNIT_COMPUTED),
        (CanSettings, CanLinkSettings, set()),
        (CanSettings, CanAdapterSettings, {"link", "dbc_text", "channels", "queue_frames"}),
    ],
)
def test_every_field_that_is_not_computed_is_a_key_of_the_file(source, adapter, computed):
    named = {field.name for field in fields(adapter)} - computed
    assert named <= set(source.model_fields)


RING = load_plant_file(DEMO).unit[0].source
QUEUE = ModbusFifoSettings(kind="modbus_fifo", host="127.0.0.1", addresses=[1000])
"""A queue that is emptied all the time is not called all the time."""


@pytest.mark.parametrize(
    ("source", "expected_s"),
    [
        *((RING.model_copy(update={"poll_period_s": s}), s) for s in (0.05, 0.25, 1.0)),
        (QUEUE, 0.25),
    ],
)
def test_a_device_is_called_once_a_poll_period(settings, source, expected_s):
    assert retry_s(settings.model_copy(update={"source": source})) == expected_s


DEPLOY = Path(__file__).parents[3] / "deploy"
PLACE = {"kind": "can", "interface": "slcan", "channel": "socket://127.0.0.1:0"}


def can_keys(**keys) -> CanSettings:
    return CanSettings.model_validate(PLACE | keys, context={FOLDER: DEPLOY / "can"})


@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
async def test_a_simulated_unit_is_read_over_can_as_without_a_wire(fd, settings, stepped_clock):
    source = can_keys(profile="padwatch_int16", fd=fd)
    feed, same = (simulated_feed(settings, stepped_clock) for _ in range(2))
    async with can_daq_of(settings, source, feed, None, patient=False) as server:
        found = can_keys(profile="padwatch_int16", fd=fd, **server.endpoint)
        reader = CanSource(
            can_settings_of(settings, found), calibration_of(settings), stepped_clock
        )
        async with reader.connect() as stream:
            for _ in range(3):
                block = await anext(stream)
                raw = same.advance(block.n_samples)
                gains = [c.unit_per_count for c in calibration_of(settings).channels]
                expected = raw.counts.astype(np.float32) * np.float32(gains)[:, np.newaxis]
                np.testing.assert_array_equal(block.samples, expected)
                assert (block.epoch, block.first_index) == (raw.epoch, raw.first_index)
                assert block.side.slow[0, 0] == pytest.approx(raw.side.slow[0, 0], rel=1e-7)


def test_the_example_dbc_is_that_of_the_demo_plant(settings):
    for name, fd in (("demo_classic.dbc", False), ("demo_fd.dbc", True)):
        shape = can_shape_of(settings, can_keys(profile="padwatch_int16", fd=fd))
        assert daq_dbc(shape) == (DEPLOY / "can" / name).read_text(encoding="utf-8")


def test_the_example_dbc_can_be_named_as_any_other(settings, stepped_clock):
    waves = {c.id: f"WAVE_{n // 3}.{c.id}" for n, c in enumerate(settings.channel)}
    source = can_keys(
        dbc="demo_classic.dbc",
        signals=waves,
        slow={s.id: f"SLOW_{n}.{s.id}" for n, s in enumerate(settings.slow_channel)},
        counters=[f"WAVE_{n}.counter" for n in range(4)],
    )
    source.check_channels([c.id for c in settings.channel], [s.id for s in settings.slow_channel])
    CanSource(can_settings_of(settings, source), calibration_of(settings), stepped_clock)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"profile": "padwatch_int16", "channel": "can0"}, "a simulated DAQ cannot use channel"),
        (
            {"profile": "padwatch_int16", "channel": "socket://127.0.0.1:x"},
            "a simulated DAQ cannot use channel",
        ),
        ({"dbc": "demo_classic.dbc", "signals": {"x": "A.b"}}, "reads CAN by its own DBC"),
    ],
)
def test_a_daq_that_cannot_be_simulated_is_refused(keys, said, settings, stepped_clock):
    feed = simulated_feed(settings, stepped_clock)
    with pytest.raises(LookupError, match=said):
        can_daq_of(settings, can_keys(**keys), feed, None, patient=False)
