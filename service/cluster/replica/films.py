"""`ReplicaFilms`: films and their baselines, as the processes that analyse have written down."""

from collections.abc import Mapping

from core.baseline.baseline import BearingBaseline
from core.change.decision import INITIAL_DECISION
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from service.live.film_actions import FilmPlace
from service.live.unit_state import UnitState
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.store.film_port import FilmStore

Key = tuple[str, str]
"""Unit and bearing."""


class ReplicaFilms:
    """Looks at reports for what was found, and at the store for baselines."""

    def __init__(self, plant: PlantFile, store: FilmStore) -> None:
        self._store = store
        found = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
        self._settings = plant.films
        self._rules = {unit: rules for unit, rules in found.items() if isinstance(rules, FilmRules)}
        self._unwatched = {unit: why for unit, why in found.items() if isinstance(why, str)}
        self._newest: dict[Key, FilmNews] = {}
        self._baselines: dict[Key, BearingBaseline] = {}

    @property
    def settings(self) -> FilmAlarmSettings:
        """How films are watched."""
        return self._settings

    @property
    def unwatched(self) -> Mapping[str, str]:
        """Why films cannot be watched, by unit where they cannot."""
        return self._unwatched

    def rules(self, unit: str) -> FilmRules | None:
        """How the films of a unit are watched; None if they are not."""
        return self._rules.get(unit)

    def place(self, unit: str, bearing: str) -> FilmPlace | None:
        """A bearing with the estimator that it is watched by; None if it is not watched."""
        rules = self.rules(unit)
        if rules is None or bearing not in rules.estimators:
            return None
        return FilmPlace(unit, bearing, rules.estimators[bearing])

    def newest(self, unit: str, bearing: str) -> FilmNews | None:
        """What has been said of a bearing last."""
        return self._newest.get((unit, bearing))

    def baseline(self, unit: str, bearing: str) -> BearingBaseline | None:
        """What a bearing is compared with now."""
        return self._baselines.get((unit, bearing))

    def fetch(self, unit: str, state: UnitState) -> Mapping[str, BearingBaseline]:
        """Read the baselines that are in force by what was written down; blocks.

        Raises
        ------
        StoreError
            If they cannot be read.
        """
        found = {}
        for bearing, version in state.baselines.items():
            held = self.baseline(unit, bearing)
            is_held = held is not None and held.origin.version == version
            baseline = held if is_held else self._store.baseline(unit, bearing, version)
            if baseline is not None:
                found[bearing] = baseline
        return found

    def take(self, unit: str, state: UnitState, baselines: Mapping[str, BearingBaseline]) -> None:
        """Take what was written down of a unit, with the baselines that `fetch` has read."""
        for bearing, film in state.films.items():
            news = FilmNews(film.reading, film.findings, (INITIAL_DECISION, INITIAL_DECISION))
            self._newest[unit, bearing] = news
        others = {key: held for key, held in self._baselines.items() if key[0] != unit}
        self._baselines = others | {(unit, b): found for b, found in baselines.items()}
