"""How far results reach is known after a stop, and with it what is missing since."""

from dataclasses import replace
from typing import Any

from rigs.assessments import assessment
from rigs.store_fixtures import at

from core.samples.gaps import Gap, Reach
from service.store.port import UnitGap


def test_results_reach_as_far_as_the_newest_of_any_bearing(store: Any) -> None:
    assert store.reach("U1") is None
    found = [assessment(at(n), speed_rpm=90.0) for n in range(3)]
    windows = [replace(a.window, epoch=7, stop_index=1000 * n + 1000) for n, a in enumerate(found)]
    results = [replace(a, window=w) for a, w in zip(found, windows, strict=True)]
    later = replace(results[2], bearing="TJB", time_ns=at(5))
    store.append([*results, replace(later, window=replace(windows[2], stop_index=9000))], [])
    store.append([replace(results[0], unit="U2", time_ns=at(9))], [])

    assert store.reach("U1") == Reach(7, 9000, at(5))


def test_gaps_behind_the_newest_result_are_known_as_they_were_recorded(store: Any) -> None:
    found = assessment(at(1), speed_rpm=90.0)
    store.append([replace(found, window=replace(found.window, epoch=7, stop_index=1000))], [])
    behind = (
        Gap(7, 1000, 5, at(2), at(1)),
        Gap(7, 1000, 0, at(3), at(2), is_estimated=True),
        Gap(7, 1100, 5, at(4)),
    )
    others = (Gap(7, 900, 10, at(0)), Gap(8, 1000, 10, at(5)))
    store.append([], [UnitGap("U1", gap) for gap in (*behind, *others)])
    store.append([], [UnitGap("U2", Gap(7, 2000, 10, at(6)))])

    store.append([], [UnitGap("U1", behind[1])])  # as two starts record the same outage
    reach = store.reach("U1")

    assert set(reach.gaps) == set(behind)
    found_gaps = store.gaps("U1", 0, 2**62)
    assert (set(found_gaps), len(found_gaps)) == ({*behind, *others}, 5)
