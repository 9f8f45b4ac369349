"""What each damage shows in what is measured: enough to tell film, bracket and transducer apart."""

from collections.abc import Callable

import numpy as np
import pytest

from acquisition.simulated.life.condition_change import cooling_failure, four_fold
from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.life_truth import UnitLife
from core.arrays import FloatArray

Life = Callable[..., UnitLife]
Day = Callable[[float], int]
SEED = 1


def seen(two_years: Life, damage: Damage, from_ns: int) -> dict[str, FloatArray]:
    """Median of what is measured over what a healthy twin shows, x and y, once damage is there."""
    healthy, ill = (
        life.readings[damage.bearing] for life in (two_years(SEED), two_years(SEED, damage))
    )
    late = healthy.time_ns >= from_ns

    def ratio(of: FloatArray) -> FloatArray:
        return np.asarray(np.nanmedian(of[:, late], axis=1))

    return {
        "stiffness": np.exp(ratio(ill.ln_k - healthy.ln_k)),
        "shaft": ratio(ill.shaft_um_pk / healthy.shaft_um_pk),
        "bearing": ratio(ill.bearing_um_pk / healthy.bearing_um_pk),
        "eccentricity": ratio((ill.eccentricity_ratio / healthy.eccentricity_ratio)[np.newaxis]),
    }


@pytest.mark.parametrize("loss", [0.05, 0.1, 0.2])
def test_a_film_that_loses_stiffness_lets_the_shaft_move_more_and_the_bearing_hardly(
    two_years: Life, day_ns: Day, loss: float
) -> None:
    found = seen(
        two_years, Damage(DamageKind.STIFFNESS_LOSS, "UJB", day_ns(500), loss), day_ns(500)
    )

    np.testing.assert_allclose(found["stiffness"], 1.0 - loss, rtol=1e-3)
    assert np.all(found["shaft"] > 1.0 + 0.5 * loss)
    assert np.all(np.abs(found["bearing"] - 1.0) < 0.5 * loss)


def test_clearance_grown_over_90_days_takes_its_tenth_in_the_end_and_half_of_it_half_way(
    two_years: Life, day_ns: Day
) -> None:
    damage = Damage(DamageKind.CLEARANCE_GROWTH, "LJB", day_ns(400), 0.1, ramp_days=90.0)
    life = two_years(SEED, damage)
    loss, time_ns = life.truth["LJB"].film_loss, life.operation.time_ns

    half_way = (time_ns > day_ns(444)) & (time_ns < day_ns(446))
    np.testing.assert_allclose(loss[:, half_way].mean(axis=1), 0.05, rtol=0.03)
    np.testing.assert_allclose(loss[:, time_ns > day_ns(491)], 0.1, rtol=1e-9)
    # the shaft has followed the pads: (1 - 0.1)^(-1/3)
    found = seen(two_years, damage, day_ns(491))
    np.testing.assert_allclose(found["eccentricity"], 1.036, atol=0.003)


def test_a_worn_pivot_softens_the_film_towards_its_pad(two_years: Life, day_ns: Day) -> None:
    damage = Damage(DamageKind.PIVOT_WEAR, "UJB", day_ns(400), 0.3, ramp_days=30.0)
    truth = two_years(SEED, damage).truth["UJB"]
    x_um, y_um = np.median(truth.centre_um, axis=1)

    late = truth.film_loss[:, two_years(SEED).operation.time_ns > day_ns(431)].mean(axis=1)
    along = 0 if abs(x_um) > abs(y_um) else 1
    assert np.all(late > 0.0)
    assert late[along] > late[1 - along]
    assert 0.02 < late[along] < 0.5


def test_oil_that_thins_takes_stiffness_in_proportion(two_years: Life, day_ns: Day) -> None:
    damage = Damage(DamageKind.OIL_DEGRADATION, "TJB", day_ns(400), 0.15)
    found = seen(two_years, damage, day_ns(400))

    np.testing.assert_allclose(found["stiffness"], 0.85, rtol=1e-3)
    np.testing.assert_allclose(found["eccentricity"], 1.0)


def test_a_loose_bracket_looks_like_a_stiffer_film_whose_bearing_moves_more(
    two_years: Life, day_ns: Day
) -> None:
    damage = Damage(DamageKind.BRACKET_LOOSENING, "UJB", day_ns(500), 0.2)
    found = seen(two_years, damage, day_ns(500))

    np.testing.assert_allclose(found["stiffness"], 1.0 / 0.8, rtol=1e-3)
    assert np.all(found["bearing"] > 1.1)
    assert np.all(found["shaft"] < 1.02)
    assert np.max(np.abs(two_years(SEED, damage).truth["UJB"].film_loss)) == 0.0


def test_an_accelerometer_that_loses_a_fifth_looks_like_a_film_but_its_shaft_stays(
    two_years: Life, day_ns: Day
) -> None:
    damage = Damage(DamageKind.ACCELEROMETER_GAIN, "UJB", day_ns(500), -0.2, directions=("x",))
    found = seen(two_years, damage, day_ns(500))

    np.testing.assert_allclose(found["stiffness"], [0.8, 1.0], rtol=1e-9)
    np.testing.assert_allclose(found["bearing"], [0.8, 1.0], rtol=0.01)
    np.testing.assert_allclose(found["shaft"], 1.0)


def test_a_probe_that_drifts_changes_shaft_motion_stiffness_and_position_together(
    two_years: Life, day_ns: Day
) -> None:
    damage = Damage(DamageKind.PROBE_GAIN, "UJB", day_ns(400), 0.1, ramp_days=60.0)
    found = seen(two_years, damage, day_ns(461))

    np.testing.assert_allclose(found["stiffness"], 1.0 / 1.1, rtol=1e-9)
    np.testing.assert_allclose(found["shaft"], 1.1, rtol=0.01)
    np.testing.assert_allclose(found["bearing"], 1.0)
    assert found["eccentricity"][0] == pytest.approx(1.1, abs=0.01)


def test_equation_5_of_the_amplitudes_follows_the_stiffness_that_is_told(
    two_years: Life, day_ns: Day
) -> None:
    # up to cross-coupling and what is left of runout: 8 % each (model of the paper)
    for damage in (
        Damage(DamageKind.STIFFNESS_LOSS, "UJB", day_ns(500), 0.2),
        Damage(DamageKind.BRACKET_LOOSENING, "UJB", day_ns(500), 0.2),
        Damage(DamageKind.ACCELEROMETER_GAIN, "UJB", day_ns(500), -0.2),
        Damage(DamageKind.PROBE_GAIN, "UJB", day_ns(500), 0.2),
    ):
        found = seen(two_years, damage, day_ns(500))
        np.testing.assert_allclose(
            found["bearing"] / found["shaft"], found["stiffness"], rtol=0.05, err_msg=damage.kind
        )


@pytest.mark.parametrize("stiffer", [True, False])
def test_condition_alone_changes_stiffness_four_times(
    two_years: Life, day_ns: Day, stiffer: bool
) -> None:
    life = two_years(SEED, changes=four_fold(day_ns(560), stiffer=stiffer))
    time_ns, usual = life.operation.time_ns, two_years(SEED)
    before = (time_ns > day_ns(532)) & (time_ns < day_ns(560))
    after = (time_ns > day_ns(560.1)) & (time_ns < day_ns(588))

    for name, truth in life.truth.items():
        step = np.median(truth.ln_k[:, after], axis=1) - np.median(truth.ln_k[:, before], axis=1)
        factor = np.exp(np.max(np.abs(step)))
        assert factor > 3.4, name
        assert np.all(step > 0.0) == stiffer, name
        np.testing.assert_array_equal(truth.film_loss, 0.0)
        healthy_most = usual.readings[name].eccentricity_ratio.max()
        assert life.readings[name].eccentricity_ratio[before | after].max() < healthy_most + 0.05


def test_a_failing_cooler_leads_out_of_everything_seen_before(two_years: Life, day_ns: Day) -> None:
    life = two_years(SEED, changes=(cooling_failure(day_ns(420)),))
    time_ns = life.operation.time_ns
    hot = (time_ns > day_ns(420.5)) & (time_ns < day_ns(425))

    for name, readings in life.readings.items():
        seen_before = two_years(SEED).readings[name].oil_temperature_c.max()
        assert np.median(readings.oil_temperature_c[hot]) > seen_before + 2.5, name


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"size": 0.0}, "size = 0"),
        ({"size": 1.0}, "size = 1"),
        ({"size": -0.1}, "size = -0.1"),
        ({"size": float("nan")}, "size = nan"),
        ({"ramp_days": -1.0}, "ramp_days = -1"),
        ({"directions": ("z",)}, "directions = "),
    ],
)
def test_damage_that_makes_no_sense_is_refused_with_key_and_value(
    changed: dict[str, object], message: str
) -> None:
    given: dict[str, object] = {"size": 0.1} | changed
    with pytest.raises(ValueError, match=message):
        Damage(DamageKind.STIFFNESS_LOSS, "UJB", 0, **given)  # type: ignore[arg-type]
