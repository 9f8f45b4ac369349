"""Plant files that come with padwatch load, and no file at all brings the loader down."""

import copy
import random
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.calibration import calibrate
from acquisition.clock import SystemClock
from core.machine import Measurand
from core.monitor import UnitMonitor
from service.conversion import analysis_of, calibration_of, machine_of
from service.settings.loading import PlantFileError, load_plant_file
from service.settings.plant import PlantFile
from service.wiring.simulations import simulated_feed

DEPLOY = Path(__file__).parents[3] / "deploy"

VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["ujb_shaft_x", "UJB", "speed", "simulated", "V/mm", 0, -1, 1e300, 2**70]),
    st.lists(st.floats(), max_size=3),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)


@pytest.mark.parametrize("path", sorted(DEPLOY.glob("*.toml")), ids=lambda path: path.name)
def test_every_plant_file_that_comes_with_padwatch_loads(path: Path) -> None:
    plant = load_plant_file(path)

    for unit in plant.unit:
        machine, calibration = machine_of(unit), calibration_of(unit)
        assert len(calibration.channels) == len(machine.channels)
        assert [b.id for b in machine.bearings] == [b.id for b in unit.bearing]


def test_a_probe_sees_its_gap_shrink_unless_the_file_says_otherwise(plant_text: str) -> None:
    unit = load_text(plant_text).unit[0]
    turned = load_text(
        plant_text.replace('"proximity_probe"', '"proximity_probe"\ndirection = 1', 1)
    )

    assert [c.direction for c in machine_of(unit).channels[:4]] == [-1, -1, 1, 1]
    assert machine_of(turned.unit[0]).channels[0].direction == 1
    assert machine_of(unit).channels[0].measurand is Measurand.GAP_UM


@pytest.mark.parametrize(
    ("transducer", "sensitivity", "sensitivity_unit", "unit_per_v"),
    [
        ("proximity_probe", "-4.0", "V/mm", -250.0),
        ("proximity_probe", "8.0", "mV/um", 125.0),
        ("velocity", "100.0", "mV/(mm/s)", 10.0),
        ("accelerometer", "1000.0", "mV/g", 9.80665),
        ("accelerometer", "100.0", "mV/(m/s2)", 10.0),
    ],
)
def test_a_sensitivity_becomes_engineering_units_per_volt(
    plant_text: str, transducer: str, sensitivity: str, sensitivity_unit: str, unit_per_v: float
) -> None:
    text = plant_text.replace('"proximity_probe"', f'"{transducer}"', 1)
    text = text.replace("sensitivity = 4.0", f"sensitivity = {sensitivity}", 1)
    text = text.replace('"V/mm"', f'"{sensitivity_unit}"', 1)

    channel = calibration_of(load_text(text).unit[0]).channels[0]

    assert channel.unit_per_v == pytest.approx(unit_per_v, rel=1e-12)


def test_the_shortest_segment_a_file_may_ask_for_gives_results(plant_text: str) -> None:
    analysis = "[analysis]\nsegment_samples = 3121\nmax_frequency_hz = 3.1\n[[unit]]"
    plant = load_text(plant_text.replace("[[unit]]", analysis, 1))
    unit = plant.unit[0]
    feed = simulated_feed(unit, SystemClock())
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))

    results = monitor.ingest(calibrate(feed.advance(3200), calibration_of(unit)))

    assert {r.bearing for r in results} == {"UJB", "LJB", "TJB"}
    assert all(r.readings["order1_shaft_x_um_pk"].value for r in results)


@given(choose=st.randoms(), values=st.lists(VALUES, min_size=1, max_size=4))
@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_no_plant_file_ever_yields_anything_but_a_plant_or_a_refusal(
    tmp_path: Path, choose: random.Random, values: list[Any]
) -> None:
    data = tomllib.loads((DEPLOY / "demo.toml").read_text(encoding="utf-8"))
    data["unit"] = data["unit"][:1]
    for value in values:
        _mutate(data, value, choose)
    path = tmp_path / "plant.toml"
    path.write_text(_toml(data), encoding="utf-8")

    try:
        plant = load_plant_file(path)
    except PlantFileError as refusal:
        lines = str(refusal).split("\n")
        assert all(line.startswith(f"{path}:") for line in lines)
    else:
        assert isinstance(plant, PlantFile)
        for unit in plant.unit:
            calibration_of(unit)
            machine_of(unit)


def load_text(text: str) -> PlantFile:
    return PlantFile.model_validate(tomllib.loads(text))


def _mutate(data: dict[str, Any], value: Any, choose: random.Random) -> None:
    """Drop, rename, replace or repeat something somewhere."""
    places = [(container, key) for container, key in _places(data)]
    container, key = choose.choice(places)
    match choose.randrange(4):
        case 0:
            del container[key]
        case 1 if isinstance(container, dict):
            container[str(value)] = container.pop(key)
        case 2 if isinstance(container, list):
            container.append(copy.deepcopy(container[key]))
        case _:
            container[key] = value
    if not data:
        data["plant"] = value


def _places(node: Any) -> list[tuple[Any, Any]]:
    items = node.items() if isinstance(node, dict) else enumerate(node)
    found = []
    for key, value in items:
        found.append((node, key))
        if isinstance(value, dict | list):
            found += _places(value)
    return found


def _toml(data: dict[str, Any]) -> str:
    """Write tables as headers, so that lines are found as in files that people write."""
    lines: list[str] = []

    def table(node: dict[str, Any], path: tuple[str, ...]) -> None:
        tables = {
            key: value
            for key, value in node.items()
            if isinstance(value, dict)
            or (isinstance(value, list) and value and all(isinstance(v, dict) for v in value))
        }
        for key, value in node.items():
            if key not in tables and value is not None:
                lines.append(f"{_quoted(key)} = {_value(value)}")
        for key, value in tables.items():
            inner = (*path, key)
            header = ".".join(_quoted(part) for part in inner)
            for element in value if isinstance(value, list) else [value]:
                lines.append(f"[[{header}]]" if isinstance(value, list) else f"[{header}]")
                table(element, inner)

    table(data, ())
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    plain = text.isascii() and text.replace("_", "").isalnum()
    return text if plain else _string(text)


def _string(text: str) -> str:
    points = (ord(c) if not 0xD800 <= ord(c) <= 0xDFFF else 0xFFFD for c in text)
    return '"' + "".join(f"\\U{point:08X}" for point in points) + '"'


def _value(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case int():
            return str(value)
        case float():
            return repr(value)
        case str():
            return _string(value)
        case list():
            return "[" + ", ".join(_value(v) for v in value if v is not None) + "]"
        case dict():
            return "{" + ", ".join(f"{_quoted(k)} = {_value(v)}" for k, v in value.items()) + "}"
    return '""'
