"""A unit of a plant file that lives: its past as readings, its present as samples."""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquisition.delivery.blocks import BlockAssembler
from acquisition.errors import ConfigError
from core.change.film_reading import film_reading
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.condition.shaft_readings import DIRECTION, VECTOR, pad_pattern
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.units import NS_PER_S
from service.measuring.simulated_sources import scenario_of, simulated_feed, simulated_history
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.settings.toml_file import TomlFileError

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"
CLEARANCE_UM = {"UJB": 500.0, "LJB": 615.0, "TJB": 425.0}
UNKNOWN = BearingCondition(OperatingState.UNKNOWN, False, None)
LIFE = """
[unit.simulation]
life_seed = 2
held_load = 0.95

[[unit.simulation.damage]]
bearing = "UJB"
kind = "stiffness_loss"
size = 0.2
after_s = 120.0
ramp_s = 60.0
"""


def plant_with(life: str, folder: Path) -> PlantFile:
    """The demo plant, its units living."""
    fixed = re.compile(r"\n\[unit\.simulation\]\n.*?(?=\n\[\[unit\]\]\n|\Z)", re.DOTALL)
    text = fixed.sub(lambda _: life, DEMO.read_text())
    for name, clearance_um in CLEARANCE_UM.items():
        told = re.compile(rf'(id = "{name}"\n(?:[^\[]*\n)??clearance_um = )[0-9.]+')
        text = told.sub(rf"\g<1>{clearance_um}", text)
    path = folder / "plant.toml"
    path.write_text(text)
    return load_plant_file(path)


@pytest.mark.long
def test_the_films_of_a_living_unit_are_read_as_its_past_says(tmp_path, stepped_clock):
    """Five minutes of samples, of films of which one has been damaged two hours ago."""
    now_ns = stepped_clock.now_ns()
    onset = datetime.fromtimestamp(now_ns // NS_PER_S - 7200, UTC).isoformat()
    plant = plant_with(LIFE.replace("after_s = 120.0", f"at = {onset}"), tmp_path)
    unit = plant.unit[0]
    feed, calibration = simulated_feed(unit, stepped_clock), calibration_of(unit)
    delivery = BlockAssembler(calibration)
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))
    newest: list[Assessment] = []
    for _ in range(300):
        for block in delivery.take([feed.advance(600)]):
            newest = list(monitor.steps(block)) or newest

    history = simulated_history(unit, now_ns + 300 * NS_PER_S)
    assert history.keys() == {"UJB", "LJB", "TJB"}
    for assessment in newest:
        past = history[assessment.bearing]
        film = film_reading(assessment, UNKNOWN, Estimator.DYNAMIC)
        for axis, value in enumerate(film.values):
            apart = value.ln_k - past.ln_k[axis, -1]
            assert abs(apart) < 4.0 * np.hypot(value.u_random, past.u_random[axis, -1]) + 0.01
        assert film.eccentricity_ratio == pytest.approx(past.eccentricity_ratio[-1], abs=0.01)
        assert film.oil_temperature_c == pytest.approx(past.oil_temperature_c[-1], abs=0.2)
        assert film.power_mw == pytest.approx(665.0, abs=10.0)
        assert film.speed_rpm == pytest.approx(past.speed_rpm[-1], rel=1e-3)
        shaft_um = [value.shaft_um_pk for value in film.values]
        assert shaft_um == pytest.approx(past.shaft_um_pk[:, -1].tolist(), rel=0.1)


def test_a_unit_with_fixed_films_has_no_past(stepped_clock):
    assert simulated_history(load_plant_file(DEMO).unit[0], stepped_clock.now_ns()) == {}


def test_a_unit_that_cannot_have_this_life_is_refused(tmp_path, stepped_clock):
    odd = plant_with(LIFE.replace("life_seed = 2", "life_seed = 3"), tmp_path).unit[0]
    with pytest.raises(ConfigError, match=r"rated_speed_rpm = 92\.3, but life_seed requires 90\.9"):
        simulated_feed(odd, stepped_clock)
    living = plant_with(LIFE, tmp_path).unit[0]
    narrow = living.bearing[0].model_copy(update={"clearance_um": 200.0})
    unit = living.model_copy(update={"bearing": (narrow, *living.bearing[1:])})
    with pytest.raises(ConfigError, match="UJB clearance_um = 200, but life_seed requires 500"):
        simulated_history(unit, stepped_clock.now_ns())


def test_a_life_is_no_fixed_scenario(tmp_path):
    simulation = plant_with(LIFE, tmp_path).unit[0].simulation
    assert simulation is not None
    with pytest.raises(LookupError, match="no constant scenario"):
        scenario_of(simulation)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("life_seed = 2", "life_seed = -1", "simulation.life_seed = -1"),
        ("held_load = 0.95", "held_load = 0.0", "simulation.held_load = 0.0"),
        ("held_load = 0.95", "power_mw = 300.0", "power_mw = 300.0: applies only without life"),
        ("life_seed = 2\n", "speed_rpm = 92.3\n", "held_load = 0.95: applies only with life_seed"),
        ("life_seed = 2\nheld_load = 0.95\n", "", "damage"),
        ("size = 0.2", "size = 1.2", "damage[1].size = 1.2"),
        ("size = 0.2", "size = -0.2", "damage[1].size = -0.2: must be above 0"),
        ('"stiffness_loss"', '"rust"', "damage[1].kind = 'rust'"),
        ('"UJB"', '"XJB"', "damage[1].bearing = 'XJB'"),
        ("after_s = 120.0\n", "", "exactly one of after_s and at"),
        ("after_s = 120.0", "after_s = 1.0\nat = 2026-01-01T00:00:00Z", "one of after_s and at"),
        ("after_s = 120.0", "at = 2026-01-01T00:00:00", "timezone"),
    ],
)
def test_a_wrong_life_is_refused_with_key_and_value(tmp_path, old, new, said):
    assert old in LIFE
    with pytest.raises(TomlFileError) as refusal:
        plant_with(LIFE.replace(old, new, 1), tmp_path)
    assert said in str(refusal.value)


def test_the_simulated_pads_are_hottest_on_the_side_of_the_shaft(stepped_clock):
    """Unit 2 of the demo: centre of UJB at (60, -35) µm of 200, full load."""
    unit = load_plant_file(DEMO).unit[1]
    slow = simulated_feed(unit, stepped_clock).advance(50).slow
    pads = [(slow[s.id], s.angle_deg) for s in unit.slow_channel if s.angle_deg is not None]
    pattern = pad_pattern(pads)
    assert len(pads) == 4
    assert pattern[DIRECTION].value == pytest.approx(-30.0, abs=15.0)
    assert pattern[VECTOR].value == pytest.approx(10.0 * 69.5 / 200.0, rel=0.4)
    assert slow["head"].value == pytest.approx(117.5, abs=0.1)
    assert slow["gate_opening"].value == pytest.approx(84.0, abs=1.0)
