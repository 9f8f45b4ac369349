"""Metrics of the present state of units: links, results, films and alarms."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

from core.alarms.alarm import PLANT
from core.alarms.statistics import HIDDEN
from core.change.decision import JUDGED, Verdict
from core.change.film_judge import FilmNews
from core.limits import AlarmLevel
from core.quality import Level
from service.live.alarm_list import LiveAlarms
from service.live.client import LiveClient
from service.live.current_state import LiveUnits
from service.live.status import CurrentBearing, LinkState
from service.runtime.metrics import Families
from service.settings.plant import PlantFile

Bearings = Mapping[str, Sequence[str]]
"""Bearing ids by unit id."""


def add_plant(families: Families, live: LiveClient, plant: PlantFile) -> None:
    """Add the metrics of all units, films and alarms of a plant to `families`."""
    bearings = {unit.id: [each.id for each in unit.bearing] for unit in plant.unit}
    add_units(families, live.units, bearings)
    add_films(families, live.units, live.films.newest, bearings)
    add_alarms(families, live.alarms, list(bearings))


UNITS = {
    "link_connected": "This is 1 while the device of the unit is connected.",
    "data_age_seconds": "This is the time since the newest samples of the unit arrived.",
    "result_age_seconds": "This is the age of the newest result of the bearing.",
    "bearings": "This is the number of bearings of the unit whose newest result has the quality; a"
    " bearing without a current result has the quality bad.",
    "film_stiffness_newtons_per_meter": "This is the film stiffness by the estimator.",
    "order1_pk_meters": "This is the zero-to-peak amplitude at the running speed at the probe or"
    " transducer.",
    "eccentricity_ratio": "This is the eccentricity of the shaft as a fraction of the clearance.",
    "oil_temperature_celsius": "This is the oil temperature of the bearing.",
}

UM_PER_M = 1e6


def add_units(families: Families, newest: LiveUnits, bearings: Bearings) -> None:
    """Add the metrics of all units to `families`.

    These are the state of the link, the age and quality of each result, and all usable values.
    """
    families.declare(UNITS)
    for unit, its in bearings.items():
        is_connected = newest.status(unit).state is LinkState.CONNECTED
        families.add("link_connected", is_connected, unit=unit)
        families.add("data_age_seconds", newest.data_age_s(unit), unit=unit)
        levels: Counter[Level] = Counter()
        for bearing in its:
            current = newest.current(unit, bearing)
            levels[current.quality.level] += 1
            families.add("result_age_seconds", current.age_s, unit=unit, bearing=bearing)
            _add_readings(families, current, {"unit": unit, "bearing": bearing})
        for level in Level:
            families.add("bearings", levels[level], unit=unit, quality=level.name.lower())


def _add_readings(families: Families, current: CurrentBearing, labels: Mapping[str, str]) -> None:
    def add(family: str, quantity: str, per: float = 1.0, **more: str) -> None:
        reading = current.readings[quantity]
        if reading.value is not None:
            quality = reading.quality.level.name.lower()
            families.add(family, reading.value / per, quality=quality, **labels, **more)

    estimators = current.assessment.estimators if current.assessment else {}
    for axis in "xy":
        estimator = estimators.get(axis * 2)
        if estimator is not None:
            name, quantity = "film_stiffness_newtons_per_meter", f"stiffness_{axis * 2}_n_per_m"
            add(name, quantity, direction=axis, estimator=estimator.value)
        for place in (f"shaft_{axis}", f"bearing_{axis}"):
            add("order1_pk_meters", f"order1_{place}_um_pk", UM_PER_M, place=place)
    add("eccentricity_ratio", "eccentricity_ratio")
    add("oil_temperature_celsius", "oil_temperature_c")


FILMS = {
    "films": "This is the number of films of the unit, two directions of each bearing, by the"
    " newest verdict since the service started.",
    "film_stiffness_ratio": "This is the film stiffness divided by that of the baseline under the"
    " same condition, by the most significant mean of recent readings.",
}


def add_films(
    families: Families,
    newest: LiveUnits,
    films: Callable[[str, str], FilmNews | None],
    bearings: Bearings,
) -> None:
    """Add the number of films by verdict, and the ratio of stiffness to its expected value.

    `films` returns the newest film findings of a unit's bearing; None without findings.
    """
    families.declare(FILMS)
    for unit, its in bearings.items():
        verdicts: Counter[Verdict] = Counter()
        for bearing in its:
            news = films(unit, bearing)
            is_current = newest.current(unit, bearing).is_current
            for direction, finding in zip("xy", news.findings[:2] if news else (), strict=False):
                verdicts[finding.verdict] += 1
                if is_current and finding.verdict in JUDGED and finding.change is not None:
                    labels = {"unit": unit, "bearing": bearing, "direction": direction}
                    families.add("film_stiffness_ratio", math.exp(finding.change), **labels)
        for verdict in Verdict:
            families.add("films", verdicts[verdict], unit=unit, verdict=verdict.name.lower())


ALARMS = {
    "alarms_active": "This is the number of active alarms that are not hidden; the unit `plant` is"
    " the service itself.",
    "alarms_unacknowledged": "This is the number of alarms that are not acknowledged.",
    "alarms_hidden": "This is the number of alarms shelved, suppressed or out of service.",
    "alarms_unjudged": "This is the number of alarms whose subject cannot be judged now.",
}


def add_alarms(families: Families, alarms: LiveAlarms, units: Sequence[str]) -> None:
    """Add the numbers of alarms by unit and level; alarms of unknown units count as `plant`."""
    families.declare(ALARMS)
    found = Counter(
        (alarm.identity.unit if alarm.identity.unit in units else PLANT, alarm.level)
        for alarm in alarms.alarms
        if alarm.level is not None and alarm.state not in HIDDEN
    )
    for unit in (*units, PLANT):
        for level in AlarmLevel:
            priority = level.name.lower()
            families.add("alarms_active", found[unit, level], unit=unit, priority=priority)
    count = alarms.count()
    families.add("alarms_unacknowledged", count.n_unacknowledged)
    families.add("alarms_hidden", count.n_hidden)
    families.add("alarms_unjudged", count.n_unjudged)
