"""The mark beside the database: later ones only, and none that was half written."""

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from service.store.highwater.file import SLOTS, MarkError, MarkFile, NoMarkError
from service.store.highwater.mark import SLOT_BYTES, Mark, decoded, encoded

Build = Callable[..., Mark]


def test_a_mark_comes_back_as_it_was_written_and_an_earlier_one_changes_nothing(
    file: MarkFile, mark: Build
) -> None:
    assert file.read() == mark()
    for n in range(151, 160):
        file.advance(mark(n_commits=n, nonce=f"{n:x}"))
        file.advance(mark(n_commits=n - 1, nonce="earlier"))
        assert file.read() == mark(n_commits=n, nonce=f"{n:x}")


def test_of_marks_that_many_write_at_once_the_last_one_stays(file: MarkFile, mark: Build) -> None:
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
def test_a_mark_that_was_torn_leaves_the_one_before_it(
    file: MarkFile, mark: Build, n_bytes: int
) -> None:
    before = file.path.read_bytes()
    file.advance(mark(n_commits=151, nonce="next"))
    after = file.path.read_bytes()
    (place,) = [p for p in SLOTS if before[p : p + SLOT_BYTES] != after[p : p + SLOT_BYTES]]
    torn = after[place : place + n_bytes] + before[place + n_bytes : place + SLOT_BYTES]
    file.path.write_bytes(before[:place] + torn + before[place + SLOT_BYTES :])

    assert file.read() == mark()

    file.advance(mark(n_commits=152))
    assert file.read() == mark(n_commits=152)


def test_no_bit_can_be_flipped_in_a_mark_unnoticed(mark: Build) -> None:
    slot = encoded(mark())
    assert len(slot) == SLOT_BYTES
    for bit in range(8 * SLOT_BYTES):
        flipped = bytearray(slot)
        flipped[bit // 8] ^= 1 << bit % 8
        assert decoded(bytes(flipped)) is None


@pytest.mark.parametrize("content", [b"", b"\0" * 5000, b"speed;power\n" * 1000])
def test_what_is_no_mark_is_said_to_be_damaged(file: MarkFile, mark: Build, content: bytes) -> None:
    file.path.write_bytes(content)

    with pytest.raises(MarkError, match="is damaged"):
        file.read()
    with pytest.raises(MarkError, match="is damaged"):
        file.advance(mark(n_commits=151))
    assert file.path.read_bytes() == content  # for those who find out what has happened


def test_a_mark_that_is_away_is_not_made_anew_by_the_way(tmp_path: Path, mark: Build) -> None:
    file = MarkFile(tmp_path / "none")

    with pytest.raises(NoMarkError, match="is not there"):
        file.read()
    with pytest.raises(NoMarkError, match="is not there"):
        file.advance(mark())
    assert list(tmp_path.iterdir()) == []


def test_the_mark_of_another_database_is_kept(file: MarkFile, mark: Build) -> None:
    with pytest.raises(MarkError, match="another database"):
        file.advance(mark(store="00" * 16, n_commits=999))

    assert file.read() == mark()
