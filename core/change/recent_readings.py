"""The newest readings of all films of a unit, to say what changed one of them."""

import math
from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from core.arrays import FloatArray
from core.baseline.response import MEAN_READINGS, Place, ShaftResponse
from core.baseline.stiffness_history import DIRECTIONS
from core.change.attribution import Attribution, PlaceReadings, attribute
from core.change.film_reading import FilmReading

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
        self,
        readings: Sequence[FilmReading],
        deviations: Mapping[Place, float | None],
        rises: Mapping[Place, float],
    ) -> None:
        """Take in the readings of one moment, if they are of every bearing and settled.

        Parameters
        ----------
        deviations, rises
            As `PlaceReadings` has them, where they are known.
        """
        values = {
            (reading.bearing, direction): (value, reading.attitude_deg)
            for reading in readings
            for direction, value in zip(DIRECTIONS, reading.values, strict=True)
            if reading.condition.is_settled
        }
        if set(values) != set(self._places):
            return
        rows = [
            (
                *(value.ln_k, ln_or_nan(value.shaft_um_pk), _or_nan(deviations.get(place))),
                *(rises.get(place, np.nan), attitude_deg),
            )
            for place, (value, attitude_deg) in ((place, values[place]) for place in self._places)
        ]
        self.append(np.array(rows).T)

    def append(self, column: FloatArray) -> None:
        """Take in one moment: (5, n_places), the rows of `PlaceReadings`."""
        self._columns.append(column)

    def attribution(self, place: Place, response: ShaftResponse | None) -> Attribution:
        """What a change at a place is put down to now."""
        row = self._places.index(place)
        newest = [column for column in self._columns if np.isfinite(column[2, row])]
        columns = newest[-MEAN_READINGS:] or [np.full((5, len(self._places)), np.nan)]
        readings = PlaceReadings(*np.stack(columns, axis=-1))
        return attribute(place, response, readings, self._brackets)


def ln_or_nan(amplitude: float) -> float:
    """Logarithm of an amplitude; NaN unless it is above zero."""
    return math.log(amplitude) if amplitude > 0.0 else math.nan


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value
