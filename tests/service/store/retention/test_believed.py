"""Ages count from a moment that a day of results lies behind, in both databases."""

from collections.abc import Sequence

from rigs.assessments import assessment
from rigs.old_results import HOUR_NS, SECOND_NS, T0, asked
from rigs.rolled_trends import gather_all

from acquisition.clock import Clock
from core.units import DAY_NS
from service.store.loops import RetentionLoop
from service.store.store import Store

YEAR_NS = 365 * DAY_NS


def measure(store: Store, times_ns: Sequence[int], bearing: str = "UJB") -> None:
    """Results of these times, gathered; and one more, so that the last hour is complete."""
    all_ns = [*times_ns, times_ns[-1] + HOUR_NS]
    store.append([assessment(at, bearing=bearing, speed_rpm=90.0) for at in all_ns], [])
    gather_all(store)


def hours(first: int, n: int) -> list[int]:
    """A result in each of some hours."""
    return [T0 + hour * HOUR_NS + SECOND_NS for hour in range(first, first + n)]


def n_single(store: Store) -> int:
    """How many single results there are."""
    wide = asked(start_ns=0, end_ns=1 << 61, is_page=True, max_points=1000)
    return len(store.trend(wide).time_ns)


def test_where_there_is_no_day_of_results_there_is_nothing_to_count_from(store: Store) -> None:
    assert store.retention.believed_ns() is None
    measure(store, hours(0, 22))
    # more in an hour that has some is no more time, nor is the same hour of another bearing
    measure(store, [T0 + 60 * SECOND_NS, T0 + 90 * SECOND_NS])
    measure(store, hours(50, 20), "LJB")
    assert store.retention.believed_ns() is None
    measure(store, [hours(30, 1)[0] + SECOND_NS])

    assert store.retention.believed_ns() == T0


async def test_a_clock_a_year_ahead_makes_results_old_after_a_day_of_them(
    store: Store, stepped_clock: Clock
) -> None:
    limits = {"readings_days": 30 * DAY_NS}
    measure(store, hours(0, 48))
    step_s = (T0 + 2 * YEAR_NS - stepped_clock.now_ns()) / SECOND_NS
    stepped_clock.step(step_s)  # type: ignore[attr-defined]
    ahead = [at + YEAR_NS for at in hours(48, 24)]
    measure(store, ahead[:1])
    await RetentionLoop(store.retention, limits, stepped_clock).round()
    assert n_single(store) == 51
    measure(store, ahead[1:])
    await RetentionLoop(store.retention, limits, stepped_clock).round()

    assert n_single(store) == 25
