"""The loop that deletes what is old, and the settings that say what that is."""

from collections.abc import Callable, Sequence

import pytest
from pydantic import ValidationError
from structlog.testing import capture_logs

from acquisition.clock import Clock
from core.units import DAY_NS
from service.settings.storage import RetentionSettings
from service.store.loops import LOOK_S, RETENTION_PERIOD_S, RETENTION_REST_SHARE, RetentionLoop
from service.store.port import StoreError
from service.store.retention import Ages, ages_of

LIMITS = {"readings_days": DAY_NS}


class OldStore:
    """Two bearings with some work each, which takes a second a piece."""

    def __init__(self, clock: Clock, step: Callable[[float], None]) -> None:
        self._clock, self._step = clock, step
        self.left = {1: 3, 2: 1}
        self.done: list[int] = []
        self.refusal: str | None = None
        self.held_up: str | None = None
        self.believed: int | None = clock.now_ns()
        self.asked_ns: int | None = None

    @property
    def trouble(self) -> str | None:
        return self.held_up

    def believed_ns(self) -> int | None:
        return self.believed

    def series(self) -> Sequence[int]:
        return list(self.left)

    def delete(self, series: int, limits: Ages, now_ns: int) -> bool:
        assert (limits, now_ns <= self._clock.now_ns()) == (LIMITS, True)
        if self.refusal:
            raise StoreError(self.refusal)
        self.asked_ns = now_ns
        self._step(1.0)
        self.left[series] -= 1
        self.done.append(series)
        return self.left[series] >= 0

    def prune(self, *_: object) -> bool:
        return False

    def give_back(self) -> bool:
        return False


@pytest.fixture
def old(stepped_clock: Clock) -> OldStore:
    return OldStore(stepped_clock, stepped_clock.step)  # type: ignore[attr-defined]


@pytest.fixture
def retaining(old: OldStore, stepped_clock: Clock) -> RetentionLoop:
    return RetentionLoop(old, LIMITS, stepped_clock)


async def test_bearings_take_turns_until_nothing_is_old(
    old: OldStore, retaining: RetentionLoop
) -> None:
    assert [await retaining.round() for _ in range(4)] == [True, True, True, False]
    assert old.done == [1, 2] * 4


async def test_it_rests_longer_than_it_works(
    retaining: RetentionLoop, stepped_clock: Clock
) -> None:
    begun_s = stepped_clock.monotonic_s()
    await retaining.round()

    lasted_s = stepped_clock.monotonic_s() - begun_s
    assert lasted_s == pytest.approx(2.0 * (1.0 + RETENTION_REST_SHARE))
    assert LOOK_S < RETENTION_PERIOD_S


async def test_a_store_that_fails_is_asked_again(old: OldStore, retaining: RetentionLoop) -> None:
    old.refusal = "disk full"
    assert not await retaining.round()
    old.refusal = None
    assert await retaining.round()


async def test_what_cannot_be_deleted_is_told_once(old: OldStore, retaining: RetentionLoop) -> None:
    old.held_up = "roll-ups are damaged"
    with capture_logs() as lines:
        for _ in range(3):
            await retaining.round()

    assert [line["event"] for line in lines] == ["some old data cannot be deleted"]


async def test_a_clock_that_is_years_ahead_or_less_than_a_day_of_results_makes_nothing_old(
    old: OldStore, retaining: RetentionLoop, stepped_clock: Clock
) -> None:
    stepped_clock.step(20.0 * 365.0 * 86_400.0)  # type: ignore[attr-defined]
    await retaining.round()
    assert old.asked_ns == old.believed
    old.believed, old.done = None, []
    assert not await retaining.round()
    assert old.done == []


def test_nothing_finer_is_kept_longer_than_what_is_coarser_and_zero_days_are_for_ever() -> None:
    for wrong in (
        {"readings_days": 10.0, "minutes_days": 9.0},
        {"readings_days": 0.0, "minutes_days": 9.0},
        {"minutes_days": 500.0, "ten_minutes_days": 499.0},
    ):
        with pytest.raises(ValidationError, match="must be"):
            RetentionSettings.model_validate(wrong)
    everything = dict.fromkeys(("readings_days", "minutes_days", "ten_minutes_days"), 0.0)
    RetentionSettings.model_validate(everything)
    found = ages_of(RetentionSettings(readings_days=1.5, films_days=0.0))
    assert (found["readings_days"], found.get("films_days")) == (round(1.5 * DAY_NS), None)
