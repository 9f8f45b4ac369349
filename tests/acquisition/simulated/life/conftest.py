"""Lives that several tests look at; two years take less than a second."""

from collections.abc import Callable
from functools import cache

import pytest

from acquisition.simulated.life.damage import Damage
from acquisition.simulated.life.life import live
from acquisition.simulated.life.shaft import ConditionChange
from acquisition.simulated.life.truth import UnitLife
from core.units import NS_PER_S

START_NS = 1_735_689_600 * NS_PER_S
"""1 January 2025."""

DAY_NS = 86_400 * NS_PER_S

LiveTwoYears = Callable[..., UnitLife]


@cache
def _life(seed: int, damage: tuple[Damage, ...], changes: tuple[ConditionChange, ...]) -> UnitLife:
    return live(seed, START_NS, 2.0, damage, changes)


@pytest.fixture(scope="session")
def two_years() -> LiveTwoYears:
    """Life of a seed, with damage and changes of condition."""

    def of(seed: int, *damage: Damage, changes: tuple[ConditionChange, ...] = ()) -> UnitLife:
        return _life(seed, damage, changes)

    return of


@pytest.fixture(scope="session")
def day_ns() -> Callable[[float], int]:
    """Time of a day of these lives."""
    return lambda day: START_NS + round(day * DAY_NS)
