"""All estimators side by side on the demo plant: against the truth, and against each other."""

import math
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.calibration import calibrate
from acquisition.simulated.unit import SimulatedUnit
from core.assessment import Assessment
from core.estimators import STIFFNESS_OF, Estimator
from core.monitor import UnitMonitor
from core.polarity import is_reversed
from core.quality import Level, Reason, bad, missing
from core.quantities import BY_NAME
from service.conversion import analysis_of, calibration_of, machine_of
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.wiring.simulations import scenario_of

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
) -> list[Assessment]:
    """The newest assessment of each bearing; some channels are wired the other way round."""
    machine, calibration = machine_of(unit), calibration_of(unit)
    assert unit.simulation is not None
    feed = SimulatedUnit(machine, calibration, scenario_of(unit.simulation), 11, 0)
    channels = [
        replace(c, direction=-c.direction) if c.id in reversed_channels else c
        for c in machine.channels
    ]
    described = replace(machine, channels=tuple(channels))
    monitor = UnitMonitor(described, analysis_of(plant.analysis))
    newest: list[Assessment] = []
    for _ in range(int(minutes * 60)):
        newest = monitor.ingest(calibrate(feed.advance(600), calibration)) or newest
    return newest


@pytest.fixture(scope="module")
def part_load(plant: PlantFile) -> list[Assessment]:
    return watch(plant, plant.unit[0])


def test_every_film_coefficient_lies_in_its_interval(
    plant: PlantFile, part_load: list[Assessment]
) -> None:
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


def test_the_estimators_agree_within_their_uncertainty_and_the_preferred_one_is_named(
    part_load: list[Assessment],
) -> None:
    for assessment in part_load:
        assert assessment.estimators == {"xx": Estimator.DYNAMIC, "yy": Estimator.DYNAMIC}
        for axes in ("xx", "yy"):
            found = {
                estimator: assessment.readings[name.format(axes=axes)]
                for estimator, name in STIFFNESS_OF.items()
            }
            low = max(r.interval_95[0] for r in found.values() if r.interval_95)
            high = min(r.interval_95[1] for r in found.values() if r.interval_95)
            assert low < high
            assert all(reading.interval_95 for reading in found.values())
            preferred = assessment.readings[f"stiffness_{axes}_n_per_m"]
            assert preferred == found[Estimator.DYNAMIC]


def test_a_reversed_transducer_is_a_reason_and_equation_5_stays(plant: PlantFile) -> None:
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
            assert (dynamic == missing(Reason.POLARITY)) == (axes in wrong)
            assert is_reversed(assessment.readings, axes) is (axes in wrong)
            chosen = str(assessment.estimators[axes])
            assert chosen.startswith("ratio" if axes in wrong else "dynamic")
        # it is not known whether shaft or bearing is reversed, and with them which of the two
        crossed = assessment.readings["dynamic_c_xy_n_s_per_m"]
        assert (crossed == missing(Reason.POLARITY)) == bool(wrong)
        assert set(assessment.budgets) <= {n for n, r in assessment.readings.items() if r.value}


def test_a_kaplan_unit_has_no_vortex_order(plant: PlantFile) -> None:
    kaplan = plant.unit[0].model_copy(update={"turbine": "kaplan"})
    for assessment in watch(plant, kaplan, minutes=1):
        for name, reading in assessment.readings.items():
            if name.startswith("vortex_"):
                assert reading.quality == bad(Reason.SWITCHED_OFF), name


def test_a_budget_adds_up_to_the_uncertainty_that_is_stated(part_load: list[Assessment]) -> None:
    assessment = part_load[0]
    assert set(assessment.budgets) == {
        name
        for name, quantity in BY_NAME.items()
        if quantity.has_uncertainty
        and assessment.readings[name].value is not None
        and not name.startswith(("stiffness_", "gap_growth_"))
    }
    assert len(assessment.budgets) == 41
    for name, budget in assessment.budgets.items():
        reading = assessment.readings[name]
        assert reading.value == budget.value
        contributions = [line.contribution for line in budget.lines]
        assert math.hypot(*contributions) == pytest.approx(
            math.hypot(reading.u_random or 0.0, reading.u_systematic or 0.0)
        )


def test_a_wrong_bracket_mass_shows_as_lack_of_fit(plant: PlantFile) -> None:
    """Without the bracket's inertia a film seems to stiffen with frequency: said, not hidden."""
    bearings = tuple(b.model_copy(update={"bracket_mass_kg": 0.0}) for b in plant.unit[0].bearing)
    massless = plant.unit[0].model_copy(update={"bearing": bearings})
    for assessment in watch(plant, massless):
        reading = assessment.readings["dynamic_k_xx_n_per_m"]
        assert reading.quality.reason is Reason.POOR_FIT
        assert assessment.estimators["xx"] is not Estimator.DYNAMIC
