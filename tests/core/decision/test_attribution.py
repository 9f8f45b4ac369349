"""What a change of stiffness is put down to."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from core.baseline.baseline import Watched
from core.decision.attribution import Cause, Movement, Movements, attribute
from core.decision.decision import UNDECIDED, advance
from core.decision.limits import ChangeLimits
from core.decision.movement import movement_of, movements_at
from core.decision.reading import WatchedReading
from core.stiffness_history import StiffnessHistory

UJB_X = ("UJB", "x")
PLACES = [(bearing, direction) for bearing in ("UJB", "LJB", "TJB") for direction in "xy"]


def moved(shaft: float, bearing: float, std: float = 0.01) -> Movements:
    stiffness = Movement(bearing - shaft, std)
    return Movements(stiffness, Movement(shaft, std), Movement(bearing, std))


def machine(**changed: Movements) -> dict[tuple[str, str], Movements]:
    found = dict.fromkeys(PLACES, moved(0.0, 0.0))
    found.update({tuple(name.split("_")): movements for name, movements in changed.items()})
    return found


def test_a_shaft_that_moves_more_in_a_softer_bearing_is_the_film() -> None:
    assert attribute(UJB_X, machine(UJB_x=moved(0.15, -0.07))).cause is Cause.FILM


def test_a_film_that_becomes_stiffer_is_the_film_too() -> None:
    assert attribute(UJB_X, machine(UJB_x=moved(-0.2, 0.02))).cause is Cause.FILM


def test_an_accelerometer_that_lost_a_fifth_is_not_the_film() -> None:
    found = attribute(UJB_X, machine(UJB_x=moved(0.0, np.log(0.8))))
    assert found.cause is Cause.BRACKET_OR_TRANSDUCER
    assert found.shaft_share == pytest.approx(0.0)


def test_a_bracket_that_came_loose_is_not_the_film() -> None:
    found = attribute(UJB_X, machine(UJB_x=moved(0.0, 0.3), UJB_y=moved(0.0, 0.3)))
    assert found.cause is Cause.BRACKET_OR_TRANSDUCER


def test_an_unbalance_that_grew_meanwhile_is_seen_to_be_everywhere() -> None:
    grown = {f"{b}_{d}": moved(0.3, 0.3) for b, d in PLACES}
    grown["UJB_x"] = moved(0.3, 0.3 + np.log(0.8))
    assert attribute(UJB_X, machine(**grown)).cause is Cause.BRACKET_OR_TRANSDUCER


def test_a_soft_film_seen_by_a_weak_accelerometer_is_both() -> None:
    found = attribute(UJB_X, machine(UJB_x=moved(0.15, -0.35)))
    assert found.cause is Cause.BOTH


def test_amplitudes_that_scatter_tell_nothing() -> None:
    found = attribute(UJB_X, machine(UJB_x=moved(0.1, -0.1, std=0.2)))
    assert found.cause is Cause.UNKNOWN


def test_without_amplitudes_nothing_can_be_told() -> None:
    blind = Movements(Movement(-0.2, 0.01), None, Movement(-0.2, 0.01))
    assert attribute(UJB_X, machine(UJB_x=blind)).cause is Cause.UNKNOWN


def test_all_places_that_change_alike_are_one_gain() -> None:
    alike = {
        f"{b}_{d}": Movements(Movement(-0.2, 0.02), Movement(0.0, 0.2), Movement(-0.2, 0.2))
        for b, d in PLACES
    }
    assert attribute(UJB_X, machine(**alike)).cause is Cause.BRACKET_OR_TRANSDUCER


@pytest.mark.parametrize(
    ("what", "cause"),
    [("change", Cause.FILM), ("gain", Cause.BRACKET_OR_TRANSDUCER)],
)
def test_film_and_accelerometer_are_told_apart_from_readings(
    film_life: Callable[..., StiffnessHistory],
    watch: Callable[..., Any],
    what: str,
    cause: Cause,
) -> None:
    def fall(hours: np.ndarray) -> np.ndarray:
        return np.where(hours > 125 * 24.0, np.log(0.8), 0.0)

    for seed in range(3):
        seen = watch(film_life(seed, days=130, **{what: fall}), tuple(Watched))
        movements = {
            ("UJB", d): movements_at(seen.later, seen.is_settled, seen.baseline, d, 16.0)
            for d in "xy"
        }
        assert attribute(("UJB", "x"), movements).cause is cause


def test_a_movement_is_the_same_from_decisions_and_from_a_history(
    film_life: Callable[..., StiffnessHistory], watch: Callable[..., Any]
) -> None:
    seen = watch(film_life(0, days=130), tuple(Watched))
    baseline = seen.baseline.of(Watched.SHAFT, "y")
    decision = UNDECIDED
    for row in range(len(seen.later)):
        reading = WatchedReading(
            time_ns=int(seen.later.time_ns[row]),
            is_settled=bool(seen.is_settled[row]),
            eccentricity_ratio=float(seen.later.eccentricity_ratio[row]),
            oil_temperature_c=float(seen.later.oil_temperature_c[row]),
            attitude_deg=float(seen.later.attitude_deg[row]),
            value=float(np.log(seen.later.shaft_um_pk[1, row])),
            u_random=0.0,
        )
        decision = advance(decision, reading, baseline, ChangeLimits())
    one = movement_of(decision, baseline, 16.0)
    other = movements_at(seen.later, seen.is_settled, seen.baseline, "y", 16.0).shaft
    assert one is not None
    assert other is not None
    assert (one.change, one.std) == pytest.approx((other.change, other.std), rel=0.02)
    assert movement_of(decision, baseline, 17.0) is None
