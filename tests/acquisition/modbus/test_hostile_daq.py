"""A hostile DAQ: no wrong reply becomes a sample of any kind of source, over TCP or on a line."""

import asyncio
from contextlib import AsyncExitStack

import pytest
from rigs.hostile_sources import COMMON, CONTENTS, KINDS, Trial, lies_to

FEW = 4
MANY = {"tcp": 100, "rtu": 20}
N_AT_ONCE = {"tcp": 20, "rtu": 5}
"""On a busy machine, replies of many lines at once would all come after the time-out."""

OF_RIGHT_FORM = [
    COMMON["fewer registers"],  # a queue may be that short
    *(make for lies in CONTENTS.values() for make in lies.values()),
]
"""Read again where a checksum of the content tells; all others cost the connection."""


def cases() -> list:
    """Each wrong reply to one source on each wire is fast; all contents to all sources are long."""
    fast, long = [], []
    for wire in ("tcp", "rtu"):
        sources = [source for link, source in KINDS if link == wire]
        lies = {name: make for source in sources for name, make in lies_to(wire, source).items()}
        for n, (name, make) in enumerate(lies.items()):
            lied_to = [source for source in sources if name in lies_to(wire, source)]
            for source in lied_to:
                case, id_ = (KINDS[wire, source], make), f"{source} over {wire}: {name}"
                long.append(pytest.param(*case, MANY[wire], marks=pytest.mark.long, id=id_))
                if source == lied_to[n % len(lied_to)]:
                    fast.append(pytest.param(*case, FEW, id=f"{id_}, a few"))
    return fast + long


@pytest.mark.parametrize(("kind", "make", "n_contents"), cases())
async def test_no_wrong_reply_becomes_a_sample(
    kind, make, n_contents, counting_feed, counts_calibration, clock_of_its_own
):
    n_trials = min(n_contents, N_AT_ONCE[kind.link])
    async with AsyncExitStack() as plant:
        trials = []
        for seed in range(n_trials):
            rig = kind(counting_feed(), counts_calibration(), clock_of_its_own())
            trials.append(Trial(await plant.enter_async_context(rig), seed))
        await asyncio.gather(*(trial.lie(make, n_contents // n_trials) for trial in trials))
    assert sum(trial.n_told for trial in trials) >= n_contents
    assert make in OF_RIGHT_FORM or any(trial.n_refused for trial in trials)
    for trial in trials:
        trial.assert_nothing_false()
