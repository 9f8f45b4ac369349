"""Links that are cut, silent, late, sliced, doubled, flipped or taken by others; wrong host clocks.

The whole service behind them, with a client that looks on: nothing false is stored or shown, what
is missing is recorded, alarms come and go as they should.
"""

import time

import numpy as np
import pytest
from harness.bad_link import Link
from harness.bench import LINK_ALARM, Seen, bench_of
from harness.ledger_plant import LedgerPlant
from harness.service_rig import until

N_ROUNDS = 10
LONGEST_S = 12.0
"""Longer than the ring of a device holds: then there is a gap."""

FROZEN_S = (1.0, 3.0, 10.0, 20.0, 40.0, 60.0)
CUTTING = (Link.REFUSED, Link.SWALLOWED, Link.TAKEN, Link.ANOTHER)
HARMLESS = (Link.LATE, Link.SLICED)
STATES = tuple(state for state in Link if state is not Link.WELL)
FEW = (Link.SWALLOWED, Link.FLIPPED)

OF_THE_PLANT = {"order1_shaft_x", "order1_shaft_y", "channel_not_ok", "samples_lost"}
"""What the plant's own story raises, of which the ledger of alarms judges the first two."""

OF_A_BUSY_HOST = {"analysis_late", "blocks_waiting"}

TWO_H, ONE_H = 7200.0, 3600.0
SINCE_1970_S = -1_790_000_000.0


@pytest.fixture
def plant(torture_seed: int, is_whole: bool) -> LedgerPlant:
    """One result in 1.5 s of each bearing."""
    return LedgerPlant(seed=torture_seed, load=1.0, n_units=2 if is_whole else 1)


@pytest.mark.timeout(3600)
def test_a_bad_link_makes_no_false_sample_and_no_loss_that_is_not_told(plant, tmp_path, torture):
    rng = np.random.default_rng(torture.seed)
    states = STATES if torture.is_whole else FEW
    seen = {state: Seen() for state in states}
    how = {"extra": LINK_ALARM, "period_s": torture.period_s}
    with bench_of(plant, tmp_path, torture.seed, **how) as bench:
        for _ in range(N_ROUNDS if torture.is_whole else 1):
            for state in states:
                bench.links.become(state)
                if state in CUTTING:
                    seen[state].lost_s.append(bench.wait_for_alarms())
                time.sleep(rng.uniform(0.5, LONGEST_S) if torture.is_whole else 1.0)
                if state in HARMLESS:
                    assert bench.states() == {"connected"}, state
                bench.links.become(Link.WELL)
                seen[state].back_s.append(bench.wait_until_well())
                until(lambda: not bench.active("link_lost"))
        if not torture.is_whole:
            bench.freeze(1.0)
            bench.daq.tell("U1 wrong_time 3")
            bench.step(TWO_H)
            until(lambda: abs(bench.clock()["offset_s"] or 0.0) > ONE_H)
            bench.watch.wait_for_result()
        torture.figure("\n".join(["bad links", *(its.line(state) for state, its in seen.items())]))
        assert bench.wrong() == {}


@pytest.mark.timeout(3600)
@pytest.mark.torture
def test_a_frozen_service_shows_nothing_old_as_new_and_no_false_alarm(plant, tmp_path, torture):
    lines = ["SIGSTOP and SIGCONT of the service"]
    with bench_of(plant, tmp_path, torture.seed) as bench:
        before = bench.raised()  # as where the host is busy with the start
        for frozen_s in FROZEN_S:
            bench.freeze(frozen_s)
            back_s = bench.wait_until_well()
            lines.append(f"  frozen for {frozen_s:4.0f} s: fresh again after {back_s:.2f} s")
            time.sleep(2.0 * plant.refresh_s)
        gaps = bench.gaps()
        torture.figure("\n".join([*lines, f"  {len(gaps)} gaps of U1, exact"]))
        assert set(bench.raised() - before) <= OF_THE_PLANT | OF_A_BUSY_HOST
        assert gaps
        assert not any(gap["is_estimated"] for gap in gaps)
        assert bench.wrong() == {}


@pytest.mark.timeout(3600)
@pytest.mark.parametrize(
    ("at_start_s", "steps_s", "time_zone"),
    [
        pytest.param(0.0, (TWO_H, -ONE_H, 0.0), "UTC", id="steps"),
        pytest.param(SINCE_1970_S, (0.0,), "UTC", id="1970"),
        pytest.param(0.0, (), "America/Sao_Paulo", id="another time zone"),
    ],
)
@pytest.mark.torture
def test_a_host_whose_clock_is_wrong_loses_and_doubles_nothing_and_says_so(
    plant, tmp_path, at_start_s, steps_s, time_zone, torture
):
    with bench_of(plant, tmp_path, torture.seed, at_start_s, time_zone) as bench:
        before = bench.raised()
        if at_start_s:
            until(lambda: bench.active("clock_offset"))
        for step_s in steps_s:
            bench.step(step_s)
            until(lambda wrong=bool(step_s): bool(bench.active("clock_offset")) == wrong)
            time.sleep(5.0 * plant.refresh_s)
        is_wrong = bool(at_start_s or steps_s)
        found = bench.raised()
        assert ("clock_offset" in found) == is_wrong
        assert set(found - before) <= OF_THE_PLANT | OF_A_BUSY_HOST | {"clock_offset"}
        assert bench.wrong() == {}
    torture.figure(
        f"wall clock {at_start_s:+g} s at start, then {steps_s} s, {time_zone}: nothing wrong"
    )
