"""From settings and plant file to the rules of a back-test."""

from collections.abc import Sequence

from service.cli.offline.back_test.bearing_run import BackTestRules
from service.cli.offline.back_test.histories import Place
from service.cli.offline.back_test.periods import Learning, MachineEvent
from service.settings.film_alarms import FilmAlarmSettings
from service.settings.plant import PlantFile


def places_of(plant: PlantFile) -> list[Place]:
    """Units and bearings that there are."""
    return [(unit.id, bearing.id) for unit in plant.unit for bearing in unit.bearing]


def rules_of(
    settings: FilmAlarmSettings,
    plant: PlantFile | None,
    learning: Learning,
    events: Sequence[MachineEvent],
    author: str,
    created_ns: int,
    estimator: str,
) -> BackTestRules:
    """Gather what learning and deciding need."""
    return BackTestRules(
        learning=learning,
        change=settings.change.limits(),
        baseline=settings.baseline.settings(settings.reading_h),
        operating=settings.operating.limits(1.0, 1.0),
        rated=_rated(plant) if plant else {},
        bracket_n_per_m=_brackets(plant) if plant else {},
        events=events,
        author=author,
        created_ns=created_ns,
        estimator=estimator,
    )


def _rated(plant: PlantFile) -> dict[str, tuple[float, float]]:
    return {
        unit.id: (unit.rated_speed_rpm, unit.rated_power_mw)
        for unit in plant.unit
        if unit.rated_power_mw is not None
    }


def _brackets(plant: PlantFile) -> dict[Place, float]:
    return {
        (unit.id, bearing.id): bearing.bracket_stiffness_n_per_m
        for unit in plant.unit
        for bearing in unit.bearing
    }
