"""A hostile DAQ: no wrong reply becomes a sample of any kind of source; see `test_hostile_daq`."""

import asyncio
from contextlib import AsyncExitStack

import pytest
from rigs.hostile_sources import KINDS, Trial, lies_to

N_CONTENTS = 200
N_AT_ONCE = 20

CASES = [
    pytest.param(kind, make, id=f"{source} over {link}: {name}")
    for (link, source), kind in KINDS.items()
    for name, make in lies_to(link, source).items()
]


@pytest.mark.parametrize("of", KINDS, ids=" ".join)
def test_there_are_more_than_two_dozen_kinds_of_wrong_reply_to_each_source(of):
    assert len(lies_to(*of)) >= 24


@pytest.mark.parametrize(("kind", "make"), CASES)
async def test_no_wrong_reply_becomes_a_sample(
    kind, make, counting_feed, counts_calibration, clock_of_its_own
):
    async with AsyncExitStack() as plant:
        trials = []
        for seed in range(N_AT_ONCE):
            rig = kind(counting_feed(), counts_calibration(), clock_of_its_own())
            trials.append(Trial(await plant.enter_async_context(rig), seed))
        await asyncio.gather(*(trial.lie(make, N_CONTENTS // N_AT_ONCE) for trial in trials))
    assert sum(trial.n_told for trial in trials) >= N_CONTENTS
    for trial in trials:
        trial.assert_nothing_false()
