"""More than a year of two simulated units, one of them damaged, out of files."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from acquisition.simulated.life.truth import UnitLife
from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import DIRECTIONS
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import decide_all, operation_history
from core.change.cause import UnitReadings, attribute
from core.change.settings import ChangeLimits
from core.change.shaft_response import film_columns, learn_response
from core.condition.operating_state import OperatingLimits
from core.units import DAY_NS
from service.cli.offline.backtest import BackTestResult, export_baselines, run_back_test
from service.cli.offline.backtest_bearing import BackTestRules, Learning, MachineEvent
from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_files import read_histories
from service.cli.offline.backtest_histories import BearingRows, Place
from service.runtime.times import rfc3339
from service.store.documents import from_json

START_NS = 19_723 * DAY_NS
Histories = Mapping[Place, BearingRows]
BRACKETS = {
    (unit, bearing): k
    for unit in ("U1", "U2")
    for bearing, k in (("UJB", 1.18e9), ("LJB", 3.62e9), ("TJB", 1.85e9))
}


@pytest.fixture(scope="module")
def histories(two_units: Any) -> Histories:
    return read_histories(two_units.parquet)


@pytest.fixture(scope="module")
def learning(two_units: Any) -> Learning:
    return Learning(days=two_units.learning_days)


@pytest.fixture(scope="module")
def found(histories: Histories, learning: Learning) -> BackTestResult:
    return run_back_test(histories, BackTestRules(learning, bracket_n_per_m=BRACKETS))


@pytest.mark.long
def test_csv_and_parquet_are_the_same_histories(two_units, histories):
    from_csv = read_histories(two_units.csv)
    assert set(from_csv) == set(histories) == set(BRACKETS)
    for place, rows in histories.items():
        for key, column in vars(rows.history).items():
            assert np.array_equal(getattr(from_csv[place].history, key), column, equal_nan=True)
        assert from_csv[place].state.tolist() == rows.state.tolist()
        assert from_csv[place].n_rows == rows.n_rows == (len(rows.history),) * 2


def settled(life: UnitLife, bearing: str) -> npt.NDArray[np.bool_]:
    operation, oil_c = life.operation, life.readings[bearing].oil_temperature_c
    limits = OperatingLimits(operation.rated_speed_rpm, operation.rated_power_mw)
    return operation_history(
        operation.time_ns, operation.speed_rpm, operation.power_mw, limits, oil_c
    ).is_settled


def learned_rows(two_units: Any, life: UnitLife) -> int:
    time_ns = life.operation.time_ns
    return int(np.searchsorted(time_ns, time_ns[0] + two_units.learning_days * DAY_NS))


@pytest.mark.long
def test_alarms_are_those_that_core_decides(two_units, found):
    """Straight from the simulated life, without any file."""
    expected = []
    for unit, life in two_units.lives.items():
        n = learned_rows(two_units, life)
        for bearing, history in life.readings.items():
            is_settled = settled(life, bearing)
            origin = Origin(unit, bearing, "unspecified", 1, "back-test", 0)
            baseline = learn(history.rows(0, n), is_settled[:n], origin, BaselineSettings())
            for direction in DIRECTIONS:
                film = baseline.of(f"k_{direction}")
                assert film is not None
                later = history.rows(n, len(history))
                decided = decide_all(later, is_settled[n:], f"k_{direction}", film, ChangeLimits())
                active = np.concatenate([[0], decided.level > 0, [0]])
                begins = np.flatnonzero(np.diff(active) == 1)
                expected += [
                    (rfc3339(int(later.time_ns[row])), unit, bearing, direction, change)
                    for row, change in zip(begins, decided.change[begins], strict=True)
                ]
    alarms = [(a.begin, a.unit, a.bearing, a.direction, a.raised.percent) for a in found.alarms]
    assert [alarm[:4] for alarm in alarms] == [alarm[:4] for alarm in sorted(expected)]
    percent = [100.0 * (np.exp(alarm[4]) - 1.0) for alarm in sorted(expected)]
    assert [alarm[4] for alarm in alarms] == pytest.approx(percent, rel=1e-9)
    assert {alarm[1:4] for alarm in alarms} >= {("U2", "LJB", "x"), ("U2", "LJB", "y")}


def test_damage_is_told_readings_are_counted_and_baselines_exported(
    two_units, found, histories, tmp_path
):
    """In one test, since what was found takes several seconds."""
    alarm = next(a for a in found.alarms if (a.unit, a.bearing) == ("U2", "LJB"))
    begin = alarm.begin
    assert rfc3339(two_units.damaged_ns) < begin < rfc3339(two_units.damaged_ns + 3 * DAY_NS)
    assert alarm.end is None
    assert abs(alarm.largest.percent) >= abs(alarm.raised.percent) > 4.0
    assert 0.0 < alarm.raised.u_percent < 3.0
    assert alarm.condition.state in ("speed_no_load", "part_load", "full_load")
    assert alarm.condition.cell == (
        int(alarm.condition.eccentricity_ratio / 0.05),
        int(alarm.condition.oil_temperature_c / 2.5),
    )
    assert alarm.cause.reason != "the response of the shaft has not been learned"
    assert alarm.cause.film_share is not None
    assert len(found.films) == 12
    for film in found.films:
        n_readings = len(histories[film.unit, film.bearing].history)
        assert film.learning + sum(film.verdicts.values()) == n_readings
        assert film.verdicts["normal"] > 1000
        assert film.baselines[0].cells_own > 10
    n_alarms = sum(film.n_alarms for film in found.films)
    assert found.report("readings.csv", 1, 1.0).rate.n_alarms == len(found.alarms) == n_alarms
    compared_days = [
        np.ptp(life.operation.time_ns) / DAY_NS - two_units.learning_days
        for life in two_units.lives.values()
    ]
    assert found.unit_years == pytest.approx(sum(compared_days) / 365.25, abs=0.02)
    assert export_baselines(found, tmp_path / "out") == 8
    text = (tmp_path / "out" / "U2-LJB-v1.json").read_text(encoding="utf-8")
    stored = from_json(BearingBaseline, text)
    assert stored in found.baselines
    with pytest.raises(FileExistsError):
        export_baselines(found, tmp_path / "out")


def test_a_learned_fault_is_doubted(two_units, histories):
    place = ("U2", "LJB")
    until_ns = two_units.damaged_ns + 50 * DAY_NS
    learning = Learning(days=30, until_ns=until_ns)
    found = run_back_test({place: histories[place]}, BackTestRules(learning))
    (doubt,) = found.doubts
    assert doubt.startswith("U2 LJB baseline 1: x fell by ")
    assert doubt.endswith("the service would require acceptance by an engineer")


@pytest.mark.long
def test_causes_are_told_by_the_newest_readings_of_all_bearings(two_units, found):
    alarm = next(a for a in found.alarms if (a.unit, a.bearing, a.direction) == ("U2", "LJB", "x"))
    life, baselines = two_units.lives["U2"], [b for b in found.baselines if b.origin.unit == "U2"]
    n, histories = learned_rows(two_units, life), dict(sorted(life.readings.items()))
    is_settled = {bearing: settled(life, bearing) for bearing in histories}
    places = [(b, d) for b in histories for d in DIRECTIONS]
    response = learn_response(
        {b: h.rows(0, n) for b, h in histories.items()},
        np.logical_and.reduce(list(is_settled.values()))[:n],
    )
    films = {place: _film(baselines, *place) for place in places}
    deviation = np.stack(
        [
            np.where(is_settled[b], _deviation(histories[b], films[b, d], d), np.nan)
            for b, d in places
        ]
    )
    rise = [films[b, d].eccentricity_rise(histories[b].conditions) for b, d in places]
    attitude = [histories[b].attitude_deg for b, _ in places]
    begins = [rfc3339(int(t)) == alarm.begin for t in life.operation.time_ns]
    known = np.isfinite(deviation[places.index(("LJB", "x"))])
    newest = np.flatnonzero(known[: int(np.flatnonzero(begins)[0]) + 1])[-24:]
    columns = (*film_columns(histories), deviation, np.stack(rise), np.stack(attitude))
    brackets = np.repeat([BRACKETS["U2", bearing] for bearing in histories], 2)
    readings = UnitReadings(*columns).columns(newest)
    expected = attribute(("LJB", "x"), response, readings, brackets)
    assert (alarm.cause.cause, alarm.cause.reason) == (expected.cause, expected.reason)
    assert alarm.cause.film_share == pytest.approx(expected.film_share, rel=1e-6)
    assert alarm.cause.u_film_share == pytest.approx(expected.film_share_std, rel=1e-6)


def _film(baselines: Any, bearing: str, direction: str) -> Any:
    (baseline,) = (b for b in baselines if b.origin.bearing == bearing)
    return baseline.of(f"k_{direction}")


def _deviation(history: Any, film: Any, direction: str) -> Any:
    assert film.direction == direction
    return film.compare_history(history).deviation


@pytest.mark.long
def test_an_overhaul_begins_a_new_baseline_of_its_bearing(two_units, histories):
    """What has changed before it is healthy after it, and nothing is compared across it."""
    event = MachineEvent("U2", "LJB", two_units.damaged_ns, "new pads")
    learning = Learning(days=30, until_ns=START_NS + two_units.learning_days * DAY_NS)
    unit = {place: rows for place, rows in histories.items() if place[0] == "U2"}
    found = run_back_test(unit, BackTestRules(learning, events=[event]))
    baselines = {film.bearing: film.baselines for film in found.films}
    assert [b.event for b in baselines["LJB"]] == ["", "new pads"]
    assert [b.event for b in baselines["UJB"]] == [""]
    assert not any(
        a.bearing == "LJB" and a.begin >= rfc3339(two_units.damaged_ns) for a in found.alarms
    )


def test_without_attitude_or_shaft_motion_less_is_known_and_said(histories, learning):
    rows = histories["U2", "LJB"]
    nothing = np.full(len(rows.history), np.nan)
    poorer = replace(
        rows,
        history=replace(
            rows.history, attitude_deg=nothing, shaft_um_pk=np.stack([nothing, nothing])
        ),
    )
    found = run_back_test({("U2", "LJB"): poorer}, BackTestRules(learning))
    assert found.doubts == ["U2 LJB: no attitude_deg, so its baseline does not use it"]
    assert all(q.surface.shape.has_attitude is False for q in found.baselines[0].quantities)
    assert {a.cause.reason for a in found.alarms} == {
        "readings of at least one bearing have no shaft_um_pk"
    }


def test_states_that_are_not_told_are_followed_or_asked_for(two_units, histories, learning):
    rows, life = histories["U2", "LJB"], two_units.lives["U2"]
    operation = life.operation
    untold = replace(
        rows,
        state=None,
        history=replace(rows.history, speed_rpm=operation.speed_rpm, power_mw=operation.power_mw),
    )
    rated = {"U2": (operation.rated_speed_rpm, operation.rated_power_mw)}
    followed = run_back_test({("U2", "LJB"): untold}, BackTestRules(learning, rated=rated))
    told = run_back_test({("U2", "LJB"): rows}, BackTestRules(learning))
    assert [film.verdicts for film in followed.films] == [film.verdicts for film in told.films]
    with pytest.raises(ReadingsError, match="unit U2: operating states are unknown"):
        run_back_test({("U2", "LJB"): untold}, BackTestRules(learning))


def test_readings_in_a_wrong_unit_or_without_a_condition_are_mentioned(histories, learning):
    place = ("U1", "TJB")
    rows, history = histories[place], histories[place].history
    ln_k, eccentricity = history.ln_k.copy(), history.eccentricity_ratio.copy()
    ln_k[0, 2000:2100] += np.log(1000.0)
    eccentricity[4000:4100] = np.nan
    changed = replace(history, ln_k=ln_k, eccentricity_ratio=eccentricity)
    found = run_back_test({place: replace(rows, history=changed)}, BackTestRules(learning))
    lost, *_drift, far = found.doubts
    assert lost.startswith("U1 TJB: ")
    assert 90 < int(lost.split()[2]) <= 100
    assert "no eccentricity_ratio" in lost
    assert far.startswith("U1 TJB baseline 1: ")
    assert 50 < int(far.split()[4]) <= 100
    assert far.endswith(
        "readings in x are at least twice or at most half the baseline; check units"
    )


def test_a_bearing_that_is_never_warm_is_said_to_be(histories, learning):
    place = ("U1", "TJB")
    never = OperatingLimits(1.0, 1.0, oil_settling_s=1e7, warm_up_s=1e7)
    found = run_back_test({place: histories[place]}, BackTestRules(learning, operating=never))
    (doubt,) = found.doubts
    assert doubt.startswith("U1 TJB: none of ")
    assert "each run ends before the oil temperature has settled" in doubt
