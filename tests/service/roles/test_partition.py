from pathlib import Path

import pytest

from service.roles.partition import Partition
from service.settings.loading import load_plant_file

PLANT = load_plant_file(Path(__file__).parents[3] / "deploy" / "demo.toml")
UNITS = [f"U{number:02}" for number in range(1, 21)]


@pytest.mark.parametrize("n_parts", [1, 2, 3, 7, 20])
def test_every_unit_is_in_exactly_one_share_and_all_have_about_as_many(n_parts: int) -> None:
    shares = [Partition(number, n_parts).units(UNITS[::-1]) for number in range(1, n_parts + 1)]
    assert sorted(unit for share in shares for unit in share) == UNITS
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "-1/2", "1/2/3", "a/b", "1/0", "99999/1"])
def test_what_is_no_share_is_refused_with_what_to_write(text: str) -> None:
    with pytest.raises(ValueError, match="such as 1/2"):
        Partition.of(text)


def test_a_share_without_units_is_refused() -> None:
    with pytest.raises(ValueError, match="no more than 2 parts"):
        Partition(3, 3).part_of(PLANT)


def test_one_share_raises_the_alarms_that_are_of_no_unit() -> None:
    first, second = (Partition(number, 2).share_of(PLANT) for number in (1, 2))
    assert first.looks_after("U1")
    assert not first.looks_after("U2")
    assert first.looks_after("plant")
    assert first.looks_after("a unit that is there no more")
    assert second.looks_after("U2")
    assert not second.looks_after("U1")
    assert not second.looks_after("plant")
