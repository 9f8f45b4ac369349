"""What is said of a database that is not the one that was here last."""

from collections.abc import Callable
from pathlib import Path

import pytest

from service.store.highwater.comparison import MAX_BEHIND, Kind, MarkFinding, compared
from service.store.highwater.host import host_id
from service.store.highwater.mark import Mark

Build = Callable[..., Mark]


def only(found: list[MarkFinding]) -> MarkFinding:
    (finding,) = found
    return finding


@pytest.mark.parametrize("n_behind", [1, MAX_BEHIND])
def test_a_crash_between_transaction_and_mark_is_nothing_to_tell(
    mark: Build, n_behind: int
) -> None:
    database = mark(n_commits=150 + n_behind, nonce="later")

    assert compared(mark(), database, "host") == []


def test_an_older_database_is_told_with_what_is_missing_and_since_when(mark: Build) -> None:
    older = mark(n_commits=100, nonce="older", time_ns=mark().time_ns - 3_600_000_000_000)
    found = only(compared(mark(), older, "host"))

    assert (found.kind, found.n_missing) == (Kind.ROLLED_BACK, 50)
    assert found.detail == (
        "the database was rolled back: 50 transactions, written after 2025-12-31T23:00:00Z and up"
        " to 2026-01-01T00:00:00Z, are missing"
    )


def test_an_older_database_that_has_come_as_far_again_is_told(mark: Build) -> None:
    found = only(compared(mark(), mark(nonce="another"), "host"))

    assert found.kind is Kind.ROLLED_BACK
    assert "transaction 150 is another one" in found.detail


def test_another_database_is_told(mark: Build) -> None:
    found = only(compared(mark(), mark(store="00" * 16, n_commits=7), "host"))

    assert found.kind is Kind.REPLACED
    assert "150 transactions" in found.detail
    assert "7 are in this one" in found.detail


def test_a_mark_that_is_much_older_than_the_database_is_told(mark: Build) -> None:
    found = only(compared(mark(), mark(n_commits=151 + MAX_BEHIND), "host"))

    assert (found.kind, found.n_missing) == (Kind.MARK_BEHIND, 0)


@pytest.mark.parametrize("why", ["is not there", "is damaged"])
def test_a_mark_that_says_nothing_is_told(mark: Build, why: str) -> None:
    found = only(compared(why, mark(), "host"))

    assert (found.kind, found.n_missing) == (Kind.MARK_LOST, None)
    assert why in found.detail


def test_a_copied_machine_is_told(mark: Build) -> None:
    assert only(compared(mark(), mark(), "clone")).kind is Kind.OTHER_HOST


@pytest.mark.parametrize(
    ("before", "now"), [("host", "host"), ("", "host"), ("host", ""), ("", "")]
)
def test_the_same_machine_and_those_without_a_name_are_not_taken_for_others(
    mark: Build, before: str, now: str
) -> None:
    assert compared(mark(host=before), mark(host=before), now) == []


def test_a_time_that_is_none_stops_nobody(mark: Build) -> None:
    found = only(compared(mark(), mark(n_commits=1, time_ns=2**63 - 1), "host"))

    assert found.n_missing == 149
    found = only(compared(mark(), mark(n_commits=1, time_ns=-(2**70)), "host"))
    assert "an unknown time" in found.detail


def test_machines_are_told_apart_without_giving_away_their_names(tmp_path: Path) -> None:
    names = [tmp_path / "one", tmp_path / "other"]
    for n, name in enumerate(names):
        name.write_text(f"{n:032x}\n")
    ids = [host_id(name) for name in names]

    assert ids[0] != ids[1]
    assert ids[0] == host_id(names[0])
    assert f"{0:032x}" not in ids[0]


@pytest.mark.parametrize("text", ["", "\n", "uninitialized\n"])
def test_a_machine_without_a_name_has_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "machine-id").write_text(text)

    assert host_id(tmp_path / "machine-id") == host_id(tmp_path / "none") == ""
