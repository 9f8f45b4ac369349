"""The mark beside the database against the one in it: whether it is what was here last."""

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum

from core.units import s_from_ns
from service.store.highwater.host import NO_HOST
from service.store.highwater.mark import Mark

MAX_BEHIND = 64
"""Transactions by which the file may lag: a crash leaves out those of each process's last."""


class Kind(StrEnum):
    """What can be wrong."""

    ROLLED_BACK = "rolled_back"
    REPLACED = "replaced"
    MARK_LOST = "mark_lost"
    MARK_BEHIND = "mark_behind"
    OTHER_HOST = "other_host"


@dataclass(frozen=True)
class MarkFinding:
    """What the mark says that the database does not.

    Parameters
    ----------
    n_missing
        Transactions that were acknowledged and are not there; None where nobody can tell.
    detail
        One sentence for people.
    """

    kind: Kind
    n_missing: int | None
    detail: str


def compared(mark: Mark | str, database: Mark, host: str) -> list[MarkFinding]:
    """What is wrong; nothing if the database is what was here last.

    Parameters
    ----------
    mark
        What the file says, read before the database was; or why it says nothing.
    host
        Of this machine.
    """
    if isinstance(mark, str):
        return [MarkFinding(Kind.MARK_LOST, None, _lost(mark, database))]
    found = _history(mark, database)
    if NO_HOST not in (host, mark.host) and mark.host != host:
        found.append(MarkFinding(Kind.OTHER_HOST, None, OTHER_HOST))
    return found


OTHER_HOST = (
    "the data folder was written by another machine before: if that still runs, two services"
    " take themselves for the same plant"
)


def _history(mark: Mark, database: Mark) -> list[MarkFinding]:
    if mark.store != database.store:
        return [MarkFinding(Kind.REPLACED, None, _replaced(mark, database))]
    n_missing = mark.n_commits - database.n_commits
    if n_missing > 0:
        return [MarkFinding(Kind.ROLLED_BACK, n_missing, _rolled_back(mark, database))]
    if n_missing == 0 and mark.nonce != database.nonce:
        return [MarkFinding(Kind.ROLLED_BACK, None, _parted(mark, database))]
    if n_missing < -MAX_BEHIND:
        return [MarkFinding(Kind.MARK_BEHIND, 0, _behind(mark, database))]
    return []


def _rolled_back(mark: Mark, database: Mark) -> str:
    n = mark.n_commits - database.n_commits
    last, known = _when(database.time_ns), _when(mark.time_ns)
    return (
        f"the database was rolled back: {n} transactions, written after {last} and up to {known},"
        " are missing"
    )


def _parted(mark: Mark, database: Mark) -> str:
    return (
        f"the database is not the one that was here last: transaction {database.n_commits} is"
        f" another one than the one of {_when(mark.time_ns)}"
    )


def _replaced(mark: Mark, database: Mark) -> str:
    return (
        f"the database was replaced by another one: {mark.n_commits} transactions up to"
        f" {_when(mark.time_ns)} were in the one before, {database.n_commits} are in this one"
    )


def _behind(mark: Mark, database: Mark) -> str:
    return (
        f"the high-water mark is older than the database: it knows {mark.n_commits} transactions"
        f" of {database.n_commits}"
    )


def _lost(why: str, database: Mark) -> str:
    return (
        f"the high-water mark {why}: whether the database, whose last transaction is of"
        f" {_when(database.time_ns)}, is the newest cannot be told"
    )


def _when(time_ns: int) -> str:
    try:
        moment = datetime.fromtimestamp(s_from_ns(time_ns), UTC)
    except (ValueError, OverflowError, OSError):
        return "an unknown time"
    return f"{moment:%Y-%m-%dT%H:%M:%SZ}"
