import pytest

from core.condition.cells import CellGrid
from core.condition.film_conditions import FilmConditions


def one(grid: CellGrid, e: float, t: float, attitude_deg: float = 0.0) -> tuple[int, ...]:
    cells = grid.cells(FilmConditions.one(e, t, attitude_deg))
    return tuple(int(i) for i in cells[:, 0])


def test_a_reading_lies_in_the_cell_whose_middle_is_nearest() -> None:
    grid = CellGrid(0.05, 2.5, attitude_width_deg=30.0)
    assert grid.centre(one(grid, 0.32, 41.0, 725.0)) == pytest.approx((0.325, 41.25, 15.0))


def test_frost_and_negative_attitudes_have_cells_too() -> None:
    grid = CellGrid(0.05, 2.5, attitude_width_deg=30.0)
    assert one(grid, 0.0, -0.1, -10.0) == (0, -1, 11)


def test_a_reading_without_temperature_has_no_cell() -> None:
    nan, some = float("nan"), 0.3
    assert not CellGrid().is_known(FilmConditions.one(some, nan, some))[0]
    assert CellGrid().is_known(FilmConditions.one(some, some, nan))[0]
    assert not CellGrid(attitude_width_deg=30.0).is_known(FilmConditions.one(some, some, nan))[0]


@pytest.mark.parametrize(
    ("key", "value"),
    [("eccentricity_width", 0.0), ("temperature_width_c", float("nan")), ("attitude_width_deg", 7)],
)
def test_impossible_widths_are_refused_with_key_and_value(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{key} = {value:g}"):
        CellGrid(**{key: value})
