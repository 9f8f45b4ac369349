"""The newest readings of all films of a unit, to say what changed one of them."""

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from core.arrays import FloatArray
from core.baseline.response import MEAN_READINGS, Place, ShaftResponse
from core.decision.attribution import Attribution, attribute
from core.films.film_reading import FilmReading
from core.stiffness_history import DIRECTIONS

KEPT = 4 * MEAN_READINGS
"""Readings: some say nothing of a place."""


class RecentReadings:
    """Settled readings at the same times, at all places of a unit.

    Parameters
    ----------
    brackets_n_per_m
        Stiffness of the bracket of each watched bearing.
    """

    def __init__(self, brackets_n_per_m: Mapping[str, float]) -> None:
        self._places = tuple(
            (bearing, direction) for bearing in brackets_n_per_m for direction in DIRECTIONS
        )
        self._brackets = np.repeat(list(brackets_n_per_m.values()), 2)
        self._columns: deque[FloatArray] = deque(maxlen=KEPT)

    @property
    def places(self) -> tuple[Place, ...]:
        """Bearings and directions, in the order of rows."""
        return self._places

    def add(
        self, readings: Sequence[FilmReading], deviations: Mapping[Place, float | None]
    ) -> None:
        """Take in the readings of one moment, if they are of every bearing and settled."""
        values = {
            (reading.bearing, direction): value
            for reading in readings
            for direction, value in zip(DIRECTIONS, reading.values, strict=True)
            if reading.condition.is_settled
        }
        if set(values) != set(self._places):
            return
        rows = [
            (value.ln_k, value.shaft_um_pk, _or_nan(deviations.get(place)))
            for place, value in ((place, values[place]) for place in self._places)
        ]
        self.append(np.array(rows).T)

    def append(self, column: FloatArray) -> None:
        """Take in one moment: (3, n_places) ln stiffness, 1× shaft motion in µm, deviation."""
        self._columns.append(column)

    def attribution(self, place: Place, response: ShaftResponse | None) -> Attribution:
        """What a change at a place is put down to now."""
        row = self._places.index(place)
        newest = [column for column in self._columns if np.isfinite(column[2, row])]
        columns = newest[-MEAN_READINGS:] or [np.full((3, len(self._places)), np.nan)]
        ln_k, shaft_um_pk, deviation = np.stack(columns, axis=-1)
        ln_shaft = np.log(np.where(shaft_um_pk > 0.0, shaft_um_pk, np.nan))
        return attribute(place, response, ln_k, ln_shaft, deviation, self._brackets)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value
