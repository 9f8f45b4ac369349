"""The way back from a copy that PostgreSQL's own tools have made, as the how-to shows it."""

from contextlib import closing

from harness.places import PostgresPlace
from rigs.assessments import assessment
from rigs.store_fixtures import at, query

from service.store.access.audit_entries import AuditAction
from service.store.postgres.store import server_trail


def test_a_dump_of_a_live_database_is_put_back_with_all_that_it_guards(
    own_place: PostgresPlace,
) -> None:
    server, dump = own_place.server, own_place.server.folder / "padwatch.dump"
    with closing(own_place.open()) as store:
        store.append([assessment(at(0), speed_rpm=92.3)], [])
        store.audit.record([AuditAction(1, "anna", "test.done", "before the copy")])
        there = own_place.address.conninfo
        server.run("pg_dump", "--format=custom", f"--file={dump}", f"--dbname={there}")
        store.audit.record([AuditAction(2, "anna", "test.done", "after it")])
    back = PostgresPlace(server, f"{own_place.database}_back", own_place.head.parent)
    server.create(back.database)
    server.run("pg_restore", f"--dbname={back.address.conninfo}", "--exit-on-error", dump)

    verdict = server_trail(back.address, back.head).verify()
    with closing(back.open()) as store:
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3]
        store.append([assessment(at(1), speed_rpm=92.4)], [])
        assert list(store.trend(query()).series["speed_rpm"].mean) == [92.3, 92.4]
    assert not verdict.is_whole
    assert verdict.finding is not None
    assert verdict.finding.detail == "entry 2 is missing at the end: the head names 2"
    guards = "SELECT count(*) FROM pg_trigger WHERE NOT tgisinternal"
    assert back.execute(guards) == own_place.execute(guards)
    server.drop(back.database)
