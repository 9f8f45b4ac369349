"""Runout from plant file to stiffness: a balanced machine whose surface moves more than its shaft.

Balanced to G0.4, film 0.5 GN/m, 10 µm runout, 20 kN rms hydraulic noise below 20 Hz, realistic
transducers: case of the accuracy table.
"""

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.scenario import (
    BearingScenario,
    ChannelScenario,
    HydraulicNoise,
    KeyPhasePulse,
    Scenario,
    TransducerNoise,
)
from acquisition.simulated.plant.unit import SimulatedUnit
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.quality import Reason, bad
from core.samples.blocks import SampleBlock
from core.spectra.runout import RunoutVerdict
from core.spectra.speed import SpeedSource
from service.settings.core_values import calibration_of, machine_of
from service.settings.plant import load_plant_file
from service.settings.units import UnitSettings

DEMO = Path(__file__).parents[2] / "deploy" / "demo.toml"
SECONDS = 320
RUNOUT_UM_PK = cmath.rect(10.0, math.radians(70.0))
MARK_TURNS = 0.25
"""A quarter turn on from the pick-up, so that the probe in x reads the runout at 70° - 90°."""

K_EFF_N_PER_M = 0.5e9 * 1.0073 * 1.0036
"""What equation (5) reads of the film: |k + iωc|, with the bracket's inertia left out."""

KEY_PHASE = """
[[unit.channel]]
id = "kp"
transducer = "key_phase"
full_scale_v = 10.0
ok_min_v = -1.0
ok_max_v = 9.0

[[unit.slow_channel]]"""


def slow_roll(channel: str, phase_deg: float) -> str:
    vector = f'um_pk = 10.0, phase_deg = {phase_deg}, speed_rpm = 8.0, probe = "{channel} 1"'
    return (
        f'id = "{channel}"\nprobe = "{channel} 1"\n'
        f"slow_roll = {{ {vector}, taken = 2026-03-01T10:00:00Z }}\n"
    )


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> UnitSettings:
    """The demonstration unit with a key-phase, and a slow-roll vector for the upper bearing."""
    text = DEMO.read_text(encoding="utf-8")
    for old, new in (
        ("[[unit.slow_channel]]", KEY_PHASE.lstrip()),
        ('id = "ujb_shaft_x"\n', slow_roll("ujb_shaft_x", -20.0)),
        ('id = "ujb_shaft_y"\n', slow_roll("ujb_shaft_y", -110.0)),
        ('speed_channel = "speed"', 'speed_channel = "speed"\nkey_phase = "kp"'),
    ):
        text = text.replace(old, new, 1)
    path = tmp_path_factory.mktemp("plant") / "plant.toml"
    path.write_text(text, encoding="utf-8")
    return load_plant_file(path).unit[0]


@pytest.fixture(scope="module")
def unit(settings: UnitSettings) -> Unit:
    return machine_of(settings)


def scenario(channels: Mapping[str, ChannelScenario]) -> Scenario:
    film = Film.proportional(0.5e9, 0.5e9)
    runout = (RUNOUT_UM_PK, 3.0, 1.5j, 1.0)
    return Scenario(
        bearings={
            name: BearingScenario(film, runout_um_pk=runout) for name in ("UJB", "LJB", "TJB")
        },
        unbalance_grade_mm_s=0.4,
        hydraulic=HydraulicNoise(20.0e3, 20.0),
        noise=TransducerNoise(
            gap_um_rms=1.2, accelerometer_g_per_sqrt_hz=5e-6, key_phase_v_rms=0.05
        ),
        key_phase=KeyPhasePulse(mark_turns=MARK_TURNS),
        speed_wander=0.0005,
        channels=channels,
    )


def record(
    settings: UnitSettings, channels: Mapping[str, ChannelScenario], seconds: int = SECONDS
) -> list[SampleBlock]:
    calibration = calibration_of(settings)
    feed = SimulatedUnit(machine_of(settings), calibration, scenario(channels), 11, 0)
    return [feed.advance(600) for _ in range(seconds)]


@pytest.fixture(scope="module")
def blocks(settings: UnitSettings) -> list[SampleBlock]:
    return record(settings, {})


def upper(unit: Unit, blocks: list[SampleBlock], min_coherence: float = 0.9) -> Assessment:
    """The newest assessment of the upper bearing."""
    settings = AnalysisSettings(min_coherence=min_coherence)
    monitor = UnitMonitor(unit, settings)
    found = [a for block in blocks for a in monitor.steps(block) if a.bearing == "UJB"]
    return found[-1]


def with_runout_limit(unit: Unit, runout_um_pk: float) -> Unit:
    bearings = tuple(replace(b, runout_um_pk=runout_um_pk) for b in unit.bearings)
    return replace(unit, bearings=bearings)


def with_channels(unit: Unit, **changes: object) -> Unit:
    channels = tuple(
        replace(c, **changes) if c.slow_roll else c  # type: ignore[arg-type]
        for c in unit.channels
    )
    return replace(unit, channels=channels)


@pytest.mark.long
def test_equation_5_reads_the_film_only_when_runout_of_this_probe_is_taken_off(unit, blocks):
    unit = with_runout_limit(unit, 0.0)
    found = upper(unit, blocks)
    bare = upper(with_channels(unit, slow_roll=None), blocks)
    replaced = upper(with_channels(unit, probe="another"), blocks)

    verdicts = [set(each.runout.values()) for each in (found, bare, replaced)]
    assert verdicts == [
        {RunoutVerdict.APPLIED},
        {RunoutVerdict.NO_VECTOR},
        {RunoutVerdict.OTHER_PROBE},
    ]
    for axes in ("xx", "yy"):
        name = f"order1_k_eff_{axes}_n_per_m"
        assert found.readings[name].value == pytest.approx(K_EFF_N_PER_M, rel=0.04), axes
        mistaken = bare.readings[name].value
        assert mistaken is not None
        assert mistaken < 0.55 * K_EFF_N_PER_M
    assert replaced.readings == bare.readings
    assert found.speed_source is SpeedSource.KEY_PHASE
    speed_rpm = found.readings["speed_rpm"].value
    assert speed_rpm == pytest.approx(blocks[-7].slow["speed"].value, rel=2e-4)


def test_runout_that_is_taken_off_no_longer_silences_the_line(unit, blocks):
    told = with_runout_limit(unit, 10.0)
    silent = upper(with_channels(told, slow_roll=None), blocks)
    speaking = upper(told, blocks)
    for axes in ("xx", "yy"):
        name = f"order1_transfer_k_{axes}_n_per_m"
        assert silent.readings[name].quality == bad(Reason.INSUFFICIENT_EXCITATION)
        assert speaking.readings[name].value == pytest.approx(0.5e9, rel=0.05)
        runout = [line for line in speaking.budgets[name].lines if line.name == "runout"]
        assert all(line.contribution == 0.0 for line in runout)
