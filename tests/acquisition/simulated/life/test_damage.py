"""What each damage shows in what is measured: enough to tell film, bracket and transducer apart."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

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


def of(kind: DamageKind, bearing: str, day: int, size: float, **others: Any) -> Damage:
    """Damage whose onset is a day, until a test makes it a time."""
    return Damage(kind, bearing, day, size, **others)


def within(value: float, share: float) -> tuple[float, float]:
    return value * (1.0 - share), value * (1.0 + share)


EXACTLY_1 = within(1.0, 1e-7)


def loss_of_film(loss: float) -> tuple[Damage, dict[str, Any]]:
    """The shaft moves more, and the bearing hardly."""
    return of(DamageKind.STIFFNESS_LOSS, "UJB", 500, loss), {
        "stiffness": within(1.0 - loss, 1e-3),
        "shaft": (1.0 + 0.5 * loss, 2.0),
        "bearing": (1.0 - 0.5 * loss, 1.0 + 0.5 * loss),
    }


SIGNS = {
    "a film that has lost a fifth": loss_of_film(0.2),
    "a loose bracket": (  # looks like a stiffer film whose bearing moves more
        of(DamageKind.BRACKET_LOOSENING, "UJB", 500, 0.2),
        {"stiffness": within(1.0 / 0.8, 1e-3), "shaft": (0.0, 1.02), "bearing": (1.1, 2.0)},
    ),
    "an accelerometer": (  # looks like a softer film, but its shaft stays
        of(DamageKind.ACCELEROMETER_GAIN, "UJB", 500, -0.2, directions=("x",)),
        {
            "stiffness": within(np.array([0.8, 1.0]), 1e-9),
            "shaft": EXACTLY_1,
            "bearing": within(np.array([0.8, 1.0]), 0.01),
        },
    ),
    "a probe that drifts": (
        of(DamageKind.PROBE_GAIN, "UJB", 400, 0.1, ramp_days=60.0),
        {
            "stiffness": within(1.0 / 1.1, 1e-9),
            "shaft": within(1.1, 0.01),
            "bearing": EXACTLY_1,
            "eccentricity": within(1.1, 0.01),
        },
    ),
    "oil that thins": (
        of(DamageKind.OIL_DEGRADATION, "TJB", 400, 0.15),
        {"stiffness": within(0.85, 1e-3), "eccentricity": EXACTLY_1},
    ),
}


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        *(pytest.param(*sign, id=name) for name, sign in SIGNS.items()),
        *(pytest.param(*loss_of_film(loss), marks=pytest.mark.long) for loss in (0.05, 0.1)),
    ],
)
def test_each_damage_has_its_signs(
    two_years: Life, day_ns: Day, damage: Damage, expected: dict[str, Any]
) -> None:
    over_ns = day_ns(damage.onset_ns + damage.ramp_days + 1)
    found = seen(two_years, replace(damage, onset_ns=day_ns(damage.onset_ns)), over_ns)

    for name, (low, high) in expected.items():
        assert np.all(low <= found[name]), name
        assert np.all(found[name] <= high), name
    # equation (5), up to cross-coupling and what is left of runout: 8 % each (model of the paper)
    np.testing.assert_allclose(found["bearing"] / found["shaft"], found["stiffness"], rtol=0.05)


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
