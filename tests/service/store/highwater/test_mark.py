"""The mark beside a database: as it was written, and what it says of the database that is there."""

import re
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from service.store.highwater.commits import MAX_BEHIND, Kind, MarkFinding, compared, host_id
from service.store.highwater.mark import (
    SLOT_BYTES,
    SLOTS,
    Mark,
    MarkError,
    MarkFile,
    NoMarkError,
    decoded,
    encoded,
)

MARK = Mark("5f" * 16, "host", 150, "c0ffee", 1_767_225_600_000_000_000)


def mark(**changes: object) -> Mark:
    return replace(MARK, **changes)  # type: ignore[arg-type]


@pytest.fixture
def file(tmp_path: Path) -> MarkFile:
    """A mark on the disk."""
    made = MarkFile(tmp_path / "padwatch.high-water-mark")
    made.replace(MARK)
    return made


def only(found: list[MarkFinding]) -> MarkFinding:
    (finding,) = found
    return finding


@pytest.mark.parametrize("n_behind", [1, MAX_BEHIND])
def test_a_crash_between_transaction_and_mark_is_nothing_to_tell(n_behind):
    database = mark(n_commits=150 + n_behind, nonce="later")

    assert compared(mark(), database, "host") == []


def test_an_older_database_is_told_with_what_is_missing_and_since_when():
    older = mark(n_commits=100, nonce="older", time_ns=mark().time_ns - 3_600_000_000_000)
    found = only(compared(mark(), older, "host"))

    assert (found.kind, found.n_missing) == (Kind.ROLLED_BACK, 50)
    assert found.detail == (
        "the database was rolled back: transactions written after 2025-12-31T23:00:00Z, up to"
        " 2026-01-01T00:00:00Z, are missing (50 in total)"
    )


@pytest.mark.parametrize(
    ("changes", "kind", "said"),
    [
        ({"nonce": "another"}, Kind.ROLLED_BACK, "transaction 150 differs from"),
        ({"store": "00" * 16, "n_commits": 7}, Kind.REPLACED, "150 transactions.*this one has 7"),
    ],
)
def test_an_older_database_that_has_come_as_far_again_and_another_one_are_told(changes, kind, said):
    found = only(compared(mark(), mark(**changes), "host"))

    assert found.kind is kind
    assert re.search(said, found.detail)


def test_a_mark_that_is_much_older_than_the_database_is_told():
    found = only(compared(mark(), mark(n_commits=151 + MAX_BEHIND), "host"))

    assert (found.kind, found.n_missing) == (Kind.MARK_BEHIND, 0)


@pytest.mark.parametrize(
    ("before", "now", "kinds"),
    [
        ("host", "host", []),
        ("host", "clone", [Kind.OTHER_HOST]),
        ("", "host", []),
        ("host", "", []),
        ("", "", []),
    ],
)
def test_a_copied_machine_is_told_unless_one_of_them_has_no_name(before, now, kinds):
    found = compared(mark(host=before), mark(host=before), now)
    assert [finding.kind for finding in found] == kinds


def test_a_time_that_is_none_stops_nobody():
    found = only(compared(mark(), mark(n_commits=1, time_ns=2**63 - 1), "host"))

    assert found.n_missing == 149
    found = only(compared(mark(), mark(n_commits=1, time_ns=-(2**70)), "host"))
    assert "an unknown time" in found.detail


def test_machines_are_told_apart_without_giving_away_their_names(tmp_path):
    names = [tmp_path / "one", tmp_path / "other"]
    for n, name in enumerate(names):
        name.write_text(f"{n:032x}\n")
    ids = [host_id(name) for name in names]

    assert ids[0] != ids[1]
    assert ids[0] == host_id(names[0])
    assert f"{0:032x}" not in ids[0]


@pytest.mark.parametrize("text", ["", "\n", "uninitialized\n"])
def test_a_machine_without_a_name_has_none(tmp_path, text):
    (tmp_path / "machine-id").write_text(text)

    assert host_id(tmp_path / "machine-id") == host_id(tmp_path / "none") == ""


def test_a_mark_comes_back_as_it_was_written_and_an_earlier_one_changes_nothing(file):
    assert file.read() == mark()
    for n in range(151, 160):
        file.advance(mark(n_commits=n, nonce=f"{n:x}"))
        file.advance(mark(n_commits=n - 1, nonce="earlier"))
        assert file.read() == mark(n_commits=n, nonce=f"{n:x}")


def test_of_marks_that_many_write_at_once_the_last_one_stays(file):
    def write(first: int) -> None:
        for n in range(first, 600, 4):
            MarkFile(file.path).advance(mark(n_commits=n, nonce=str(n)))

    writers = [threading.Thread(target=write, args=(200 + n,)) for n in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()

    assert file.read() == mark(n_commits=599, nonce="599")


@pytest.mark.parametrize("n_bytes", [0, 1, 100, SLOT_BYTES - 9])
def test_a_mark_that_was_torn_leaves_the_one_before_it(file, n_bytes):
    before = file.path.read_bytes()
    file.advance(mark(n_commits=151, nonce="next"))
    after = file.path.read_bytes()
    (place,) = [p for p in SLOTS if before[p : p + SLOT_BYTES] != after[p : p + SLOT_BYTES]]
    torn = after[place : place + n_bytes] + before[place + n_bytes : place + SLOT_BYTES]
    file.path.write_bytes(before[:place] + torn + before[place + SLOT_BYTES :])

    assert file.read() == mark()

    file.advance(mark(n_commits=152))
    assert file.read() == mark(n_commits=152)


def test_no_bit_can_be_flipped_in_a_mark_unnoticed():
    slot = encoded(mark())
    assert len(slot) == SLOT_BYTES
    for bit in range(8 * SLOT_BYTES):
        flipped = bytearray(slot)
        flipped[bit // 8] ^= 1 << bit % 8
        assert decoded(bytes(flipped)) is None


@pytest.mark.parametrize("content", [b"", b"\0" * 5000, b"speed;power\n" * 1000])
def test_what_is_no_mark_is_said_to_be_damaged(file, content):
    file.path.write_bytes(content)

    with pytest.raises(MarkError, match="is damaged"):
        file.read()
    with pytest.raises(MarkError, match="is damaged"):
        file.advance(mark(n_commits=151))
    assert file.path.read_bytes() == content  # for those who find out what has happened


def test_a_mark_that_is_away_is_not_made_anew_by_the_way(tmp_path):
    file = MarkFile(tmp_path / "none")

    with pytest.raises(NoMarkError, match="does not exist"):
        file.read()
    with pytest.raises(NoMarkError, match="does not exist"):
        file.advance(mark())
    assert list(tmp_path.iterdir()) == []


def test_the_mark_of_another_database_is_kept(file):
    with pytest.raises(MarkError, match="another database"):
        file.advance(mark(store="00" * 16, n_commits=999))

    assert file.read() == mark()
