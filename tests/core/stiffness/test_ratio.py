import pytest

from core.stiffness.transfer import effective_stiffness_n_per_m


def test_equal_amplitudes_of_any_unit_mean_a_film_as_stiff_as_its_bracket() -> None:
    assert effective_stiffness_n_per_m(12.0, 12.0, 1.18e9) == 1.18e9
    assert effective_stiffness_n_per_m(0.02, 0.055, 1.18e9) == pytest.approx(
        effective_stiffness_n_per_m(20.0, 55.0, 1.18e9)
    )


@pytest.mark.parametrize("shaft_um_pk", [0.0, -1.0, float("nan")])
def test_a_shaft_that_does_not_move_gives_no_stiffness(shaft_um_pk: float) -> None:
    with pytest.raises(ValueError, match="shaft amplitude"):
        effective_stiffness_n_per_m(1.0, shaft_um_pk, 1.18e9)
