"""`padwatch run` over PostgreSQL: the server stops for a while, and nothing is missing after it."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from harness.ledger_daq import LedgerDaq
from harness.ledger_plant import LedgerPlant
from harness.postgres_server import PostgresServer, why_not
from harness.service_rig import ServiceRig, until

STORE = """
[store]
postgresql = "{conninfo}"

[alarms]
store_failing_after_s = 1.0
"""
KIND = "results_not_stored"
RESULTS = "SELECT series, time_ns FROM assessment ORDER BY series, time_ns"
GAPS = "SELECT stop_ns FROM gap"
EVENTS = f"SELECT change FROM alarm_event WHERE kind = '{KIND}' ORDER BY id"  # noqa: S608
N_STOPS = 50
EVER = "start=2020-01-01T00:00:00Z&end=2100-01-01T00:00:00Z"


@pytest.fixture
def plant(torture_seed: int) -> LedgerPlant:
    """One unit with twelve channels at 600 Hz."""
    return LedgerPlant(seed=torture_seed, n_units=1, load=1.0)


@pytest.fixture
def server() -> Iterator[PostgresServer]:
    """A server that is stopped."""
    why = why_not()
    if why is not None:
        pytest.skip(why)
    with PostgresServer() as running:
        running.create("padwatch")
        yield running


@pytest.mark.timeout(3600)
def test_a_database_that_was_away_has_everything_when_it_is_back(
    plant: LedgerPlant,
    daq: LedgerDaq,
    server: PostgresServer,
    tmp_path: Path,
    times: Callable[[int], int],
) -> None:
    extra = STORE.format(conninfo=server.conninfo("padwatch"))
    plant_file = plant.write(tmp_path / "plant.toml", tmp_path / "data", daq.ports, extra)
    n_stops = times(N_STOPS) // 2 or 1
    with ServiceRig(plant_file) as rig:
        rig.start()
        rig.wait_ready()
        for _ in range(n_stops):
            n_before = len(server.execute(RESULTS, "padwatch"))
            until(lambda before=n_before: len(server.execute(RESULTS, "padwatch")) > before + 3)
            server.stop("immediate")
            until(lambda: KIND in active(rig))
            server.start()
            until(lambda: KIND not in active(rig))
        assert shown(rig) > 3
        assert rig.stop() == 0
    assert unaccounted(server, plant) == []
    changes = [str(change) for (change,) in server.execute(EVENTS, "padwatch")]
    assert changes.count("raised") == n_stops
    assert not list((tmp_path / "data").glob("*.sqlite3"))


def active(rig: ServiceRig) -> set[str]:
    """Kinds of the alarms that are active."""
    with rig.api() as api:
        found = api.get("/api/v1/alarms")["alarms"]
    return {one["kind"] for one in found if one["level"] is not None}


def shown(rig: ServiceRig) -> int:
    """Points of a trend."""
    with rig.api() as api:
        found = api.get(f"/api/v1/units/U1/bearings/UJB/trends?quantity=speed_rpm&{EVER}")
    return len(found["time"])


def unaccounted(server: PostgresServer, plant: LedgerPlant) -> list[tuple[int, int]]:
    """Holes between results, in ns, that no recorded gap in the samples explains."""
    rows = [
        (int(str(series)), int(str(time))) for series, time in server.execute(RESULTS, "padwatch")
    ]
    gaps = [int(str(stop)) for (stop,) in server.execute(GAPS, "padwatch")]
    longest_ns = round(1.5e9 * plant.refresh_s)
    window_ns = 8 * longest_ns
    return [
        (one, other)
        for (series, one), (same, other) in pairwise(rows)
        if series == same
        and other - one > longest_ns
        and not any(one - window_ns <= stop <= other + window_ns for stop in gaps)
    ]
