"""`padwatch run` over PostgreSQL: the server stops for a while, and nothing is missing after it."""

from collections.abc import Iterator

import pytest
from harness.bench import Bench
from harness.postgres_server import PostgresServer, why_not
from harness.service_rig import until

STORE = """
[store]
postgresql = "{conninfo}"

[alarms]
store_failing_after_s = 1.0
"""
NOT_STORED = "results_not_stored"
N_STOPS = 25

pytestmark = pytest.mark.skipif(why_not() is not None, reason=str(why_not()))


@pytest.fixture
def server() -> Iterator[PostgresServer]:
    """A server that is stopped."""
    with PostgresServer() as running:
        running.create("padwatch")
        yield running


@pytest.mark.timeout(3600)
def test_a_database_that_was_away_has_everything_when_it_is_back(
    plant, daq, server, tmp_path, torture
):
    extra = STORE.format(conninfo=server.conninfo("padwatch"))
    n_stops = torture.times(N_STOPS)
    with Bench(plant, daq, tmp_path, extra) as bench:
        bench.begin()
        for _ in range(n_stops):
            bench.watch.wait_for_result()
            server.stop("immediate")
            until(lambda: bench.active(NOT_STORED))
            server.start()
            until(lambda: not bench.active(NOT_STORED))
        bench.watch.wait_for_result()
        n_raised = bench.raised()[NOT_STORED]
        found = bench.end()
    assert found.wrong == {}
    assert found.n_results > 0
    assert found.n_shown > 0
    assert bench.silent_healthy_s() == 0.0
    assert n_raised == n_stops
    assert not list((tmp_path / "data").glob("*.sqlite3"))
