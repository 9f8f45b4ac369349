"""All estimators side by side on the demo plant: against the truth, and against each other."""

import math
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.simulated.plant.scenario import ChannelScenario, Scenario
from acquisition.simulated.plant.unit import SimulatedUnit
from core.machine.response import HighPass
from core.machine.unit import Estimator, Unit
from core.monitor.assessment import Assessment
from core.monitor.catalogue import BY_NAME
from core.monitor.monitor import UnitMonitor
from core.quality import Level, Reason, bad, missing, uncertain
from core.stiffness.estimators import ESTIMATORS, is_reversed
from service.measuring.simulated_sources import scenario_of
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.settings.units import UnitSettings

DEMO = Path(__file__).parents[2] / "deploy" / "demo.toml"
MINUTES = 6


@pytest.fixture(scope="module")
def plant() -> PlantFile:
    return load_plant_file(DEMO)


def watch(
    plant: PlantFile,
    unit: UnitSettings,
    minutes: float = MINUTES,
    reversed_channels: Collection[str] = (),
    scenario: Scenario | None = None,
    late: int = 0,
) -> list[Assessment]:
    """The newest assessment of each bearing; bearing channels may come some samples late.

    Some channels are wired the other way round.
    """
    machine, calibration = machine_of(unit), calibration_of(unit)
    assert unit.simulation is not None
    feed = SimulatedUnit(machine, calibration, scenario or scenario_of(unit.simulation), 11, 0)
    channels = [
        replace(c, direction=-c.direction) if c.id in reversed_channels else c
        for c in machine.channels
    ]
    described = replace(machine, channels=tuple(channels))
    monitor = UnitMonitor(described, analysis_of(plant.analysis))
    newest: list[Assessment] = []
    rows = bearing_rows(machine)
    held = np.zeros((len(rows), late), dtype=np.int16)
    for _ in range(int(minutes * 60)):
        block = feed.advance(600)
        delayed = np.concatenate([held, block.counts[rows]], axis=1)
        counts = block.counts.copy()
        counts[rows], held = delayed[:, : block.n_samples], delayed[:, block.n_samples :]
        newest = list(monitor.steps(replace(block, counts=counts))) or newest
    return newest


def bearing_rows(machine: Unit) -> list[int]:
    return [n for n, c in enumerate(machine.channels) if c.measurand.n_integrations]


@pytest.fixture(scope="module")
def base(plant: PlantFile) -> Scenario:
    assert plant.unit[0].simulation is not None
    return scenario_of(plant.unit[0].simulation)


@pytest.fixture(scope="module")
def part_load(plant: PlantFile) -> list[Assessment]:
    return watch(plant, plant.unit[0])


def test_every_film_coefficient_lies_in_its_interval(plant, part_load):
    """The simulated transducers and brackets are exact, so the random part alone must cover."""
    assert plant.unit[0].simulation is not None
    films = scenario_of(plant.unit[0].simulation).bearings
    for assessment in part_load:
        film = films[assessment.bearing].film
        for name in ("k_xx", "k_xy", "k_yx", "k_yy", "c_xx", "c_xy", "c_yx", "c_yy"):
            unit = "n_per_m" if name[0] == "k" else "n_s_per_m"
            reading = assessment.readings[f"dynamic_{name}_{unit}"]
            assert reading.quality.level is Level.GOOD
            assert reading.value is not None
            assert reading.u_random is not None
            error = reading.value - getattr(film, f"{name}_{unit}")
            assert abs(error) < 4.0 * reading.u_random, (assessment.bearing, name)
            # and it is not only because the interval is wide
            scale = film.k_xx_n_per_m if name[0] == "k" else film.c_xx_n_s_per_m
            assert reading.u_random < 0.01 * scale


def test_the_estimators_agree_within_their_uncertainty_and_the_preferred_one_is_named(part_load):
    for assessment in part_load:
        assert assessment.estimators == {"xx": Estimator.DYNAMIC, "yy": Estimator.DYNAMIC}
        for axes in ("xx", "yy"):
            found = {
                estimator: assessment.readings[entry.stiffness.format(axes=axes)]
                for estimator, entry in ESTIMATORS.items()
            }
            low = max(r.interval_95[0] for r in found.values() if r.interval_95)
            high = min(r.interval_95[1] for r in found.values() if r.interval_95)
            assert low < high
            assert all(reading.interval_95 for reading in found.values())
            preferred = assessment.readings[f"stiffness_{axes}_n_per_m"]
            assert preferred == found[Estimator.DYNAMIC]


def test_a_reversed_transducer_is_a_reason_and_equation_5_stays(plant):
    """Both shaft probes of the UJB, and one bearing transducer of the LJB."""
    upper, lower, _ = plant.unit[0].bearing
    reversed_channels = {upper.shaft_x, upper.shaft_y, lower.bearing_y}
    found = watch(plant, plant.unit[0], 1.0, reversed_channels)
    for assessment, wrong in zip(found, (("xx", "yy"), ("yy",), ()), strict=True):
        for axes in ("xx", "yy"):
            dynamic = assessment.readings[f"dynamic_k_{axes}_n_per_m"]
            preferred = assessment.readings[f"stiffness_{axes}_n_per_m"]
            assert preferred.value is not None
            assert preferred.value > 0.0
            is_doubted = preferred.quality == uncertain(Reason.POLARITY)
            assert is_doubted == (axes in wrong)
            assert (dynamic == missing(Reason.POLARITY)) == (axes in wrong)
            assert is_reversed(assessment.readings, axes) is (axes in wrong)
            chosen = str(assessment.estimators[axes])
            assert chosen.startswith("ratio" if axes in wrong else "dynamic")
        # it is not known whether shaft or bearing is reversed, and with them which of the two
        crossed = assessment.readings["dynamic_c_xy_n_s_per_m"]
        assert (crossed == missing(Reason.POLARITY)) == bool(wrong)
        assert set(assessment.budgets) <= {n for n, r in assessment.readings.items() if r.value}


def test_a_kaplan_unit_has_no_vortex_order(plant):
    kaplan = plant.unit[0].model_copy(update={"turbine": "kaplan"})
    for assessment in watch(plant, kaplan, minutes=1):
        for name, reading in assessment.readings.items():
            if name.startswith("vortex_"):
                assert reading.quality == bad(Reason.SWITCHED_OFF), name


def test_a_budget_adds_up_to_the_uncertainty_that_is_stated(part_load):
    assessment = part_load[0]
    assert set(assessment.budgets) == {
        name
        for name, quantity in BY_NAME.items()
        if quantity.has_uncertainty
        and assessment.readings[name].value is not None
        and not name.startswith(("stiffness_", "gap_growth_"))
    }
    assert len(assessment.budgets) == 55
    for name, budget in assessment.budgets.items():
        reading = assessment.readings[name]
        assert reading.value == budget.value
        contributions = [line.contribution for line in budget.lines]
        assert math.hypot(*contributions) == pytest.approx(
            math.hypot(reading.u_random or 0.0, reading.u_systematic or 0.0)
        )


def with_bearings(unit: UnitSettings, **changes: object) -> UnitSettings:
    bearings = tuple(b.model_copy(update=changes) for b in unit.bearing)
    return unit.model_copy(update={"bearing": bearings})


def test_a_wrong_bracket_mass_shows_as_lack_of_fit_and_what_stands_in_is_doubted(plant):
    """Without the bracket's inertia a film seems to stiffen with frequency: said, not hidden."""
    for assessment in watch(plant, with_bearings(plant.unit[0], bracket_mass_kg=1.0)):
        reading = assessment.readings["dynamic_k_xx_n_per_m"]
        assert reading.quality.level is Level.UNCERTAIN
        assert assessment.readings["stiffness_xx_n_per_m"].quality.level is Level.UNCERTAIN


def test_a_bracket_mass_that_is_not_given_is_found_with_the_film(plant, base):
    masses = {bearing.id: bearing.bracket_mass_kg for bearing in plant.unit[0].bearing}
    for assessment in watch(plant, with_bearings(plant.unit[0], bracket_mass_kg=None)):
        mass = assessment.readings["dynamic_bracket_mass_kg"]
        assert mass.value == pytest.approx(masses[assessment.bearing], abs=4.0 * mass.u_random)
        assert mass.u_random < 0.2 * mass.value
        stiffness = assessment.readings["stiffness_xx_n_per_m"]
        assert assessment.estimators["xx"] is Estimator.DYNAMIC
        assert stiffness.quality.level is Level.GOOD
        true = base.bearings[assessment.bearing].film.k_xx_n_per_m
        assert stiffness.value == pytest.approx(true, abs=4.0 * stiffness.u_random)
        assert stiffness.u_random < 0.01 * true


def test_a_corner_that_the_plant_file_does_not_know_leaves_no_stiffness_good(plant, base):
    """Transducers with a corner of 0.5 Hz: dynamic and transfer differ in damping threefold."""
    machine = machine_of(plant.unit[0])
    corner = ChannelScenario(response=HighPass(0.5))
    channels = {machine.channels[row].id: corner for row in bearing_rows(machine)}
    scenario = replace(base, channels={**base.channels, **channels})
    for assessment in watch(plant, plant.unit[0], 4, scenario=scenario):
        for name in (*(e.stiffness for e in ESTIMATORS.values()), "stiffness_{axes}_n_per_m"):
            for axes in ("xx", "yy"):
                quality = assessment.readings[name.format(axes=axes)].quality
                assert quality.level is not Level.GOOD, (assessment.bearing, name)
        transfer = assessment.readings["vortex_transfer_c_xx_n_s_per_m"]
        assert transfer.quality.reason is Reason.ESTIMATORS_DISAGREE


def test_bearing_channels_one_sample_late_are_noticed_and_put_right_in_the_plant_file(plant, base):
    """A sample of 600 Hz makes damping read 13 % low."""
    unit = plant.unit[0]
    late = watch(plant, unit, 4, late=1)
    channels = list(unit.channel)
    for row in bearing_rows(machine_of(unit)):
        channels[row] = channels[row].model_copy(update={"delay_s": 1.0 / 600.0})
    told = watch(plant, unit.model_copy(update={"channel": tuple(channels)}), 4, late=1)
    for assessment, right in zip(late, told, strict=True):
        true = base.bearings[assessment.bearing].film.c_xx_n_s_per_m
        for name in ("dynamic_c_xx_n_s_per_m", "order1_transfer_c_xx_n_s_per_m"):
            assert assessment.readings[name].value < 0.9 * true
            assert assessment.readings[name].quality.reason is Reason.CHANNEL_DELAY
            reading = right.readings[name]
            assert reading.quality.level is Level.GOOD
            assert reading.value == pytest.approx(true, abs=4.0 * reading.u_random)
        assert assessment.readings["stiffness_xx_n_per_m"].quality.level is not Level.GOOD
        assert assessment.readings["dynamic_delay_s"].value == pytest.approx(1 / 600, rel=0.25)
