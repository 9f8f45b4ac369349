"""Audit trail in the database: hash chain of entries, each written with the recorded change."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, astuple, dataclass, fields, replace
from heapq import merge
from itertools import repeat
from pathlib import Path
from threading import Lock

from service.store.access.audit_entries import FIRST, AuditAction, AuditEntry, chained
from service.store.access.audit_verification import (
    HEAD_DIFFERED,
    AuditHead,
    HeadError,
    Verdict,
    chain_name,
    place_of,
    read_head,
    walk,
    write_head,
)
from service.store.database import Connect, Connection, Database, Reading, Tables, insert
from service.store.port import StoreError

COLUMNS = tuple(field.name for field in fields(AuditEntry))
ENTRIES = f"SELECT {', '.join(COLUMNS)} FROM audit"  # noqa: S608
INSERT = insert("audit", COLUMNS)
SELECT_NEWEST = "SELECT number, hash FROM audit ORDER BY number DESC LIMIT 1"
SELECT_HASH = "SELECT hash FROM audit WHERE number = ?"
SELECT = f"""
    {ENTRIES} WHERE number < :before
    AND (CAST(:actor AS TEXT) IS NULL OR actor = :actor)
    AND (CAST(:action AS TEXT) IS NULL OR action = :action)
    AND (CAST(:object AS TEXT) IS NULL OR object = :object)
    AND time_ns >= :start_ns AND time_ns < :end_ns
    ORDER BY number DESC LIMIT :limit
"""
SELECT_NEXT = f"{ENTRIES} WHERE number > ? ORDER BY number LIMIT ?"
PAGE = 1000


@dataclass(frozen=True)
class AuditQuery:
    """Query for entries of one chain, newest first; None for actor, action or object matches all.

    Parameters
    ----------
    before
        Entry number; only entries with lower numbers are returned.
    limit
        Maximum number of entries.
    start_ns, end_ns
        Half-open time range, ns since 1970 UTC.
    """

    before: int = 2**63 - 1
    limit: int = 100
    actor: str | None = None
    action: str | None = None
    object: str | None = None
    start_ns: int = -(2**63)
    end_ns: int = 2**63 - 1


class AuditChain:
    """Writer of the audit trail; all write transactions of the store are opened through it.

    Parameters
    ----------
    head
        Head file, with the number and hash of the newest entry.

    Attributes
    ----------
    head_error
        Error of the last attempt to write the head file; None if it succeeded.
    """

    def __init__(self, head: Path, database: Database) -> None:
        self._head, self._database = head, database
        self._lock = Lock()
        self._is_due = False
        self.name = chain_name(head)
        self.head_error: str | None = None

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Open a write transaction and yield its connection; then update the head file.

        The head file stays if there are no new entries and its last update succeeded. Raises
        `StoreError` if the transaction fails, but not if the head file cannot be written.
        """
        with self._lock:
            self._is_due = False
            with self._database.writing() as writer:
                yield writer
            if self._is_due or self.head_error is not None:
                self._update_head()

    def add(self, writer: Connection, actions: Iterable[AuditAction]) -> None:
        """Append the audit entries of actions within a transaction of `writing`.

        If the head file contradicts the chain, an entry that records this is appended first.
        """
        for action in actions:
            newest = newest_of(writer)
            if not self._is_due and self.head_error is None:
                difference = self._difference(writer, newest)
                if difference is not None:
                    newest = _insert(writer, _head_differed(action, newest, difference), newest)
            self._is_due = True
            _insert(writer, action, newest)

    def _difference(self, writer: Connection, newest: AuditHead) -> str | None:
        """Return how the head file contradicts the chain; None if it agrees or is only older."""
        try:
            head = read_head(self._head)
        except HeadError as error:
            is_new = not self._head.exists() and not self._database.ever_had(writer, "audit")
            return None if is_new else str(error)
        found = writer.execute(SELECT_HASH, (head.number,)).fetchone()
        hash_ = found[0] if found else FIRST if head.number == 0 else None
        if hash_ == head.hash:
            return None
        if head.number > newest.number:
            return f"the head file names entry {head.number}, but the trail ends at {newest.number}"
        return f"entry {head.number} does not match the hash in the head file"

    def _update_head(self) -> None:
        """Write the head file in a transaction, so that no process can write an older head later.

        If the write fails, the entries stay stored and the head file is updated by a later write.
        """
        self.head_error = None
        try:
            with self._database.writing() as writer:
                try:
                    write_head(self._head, newest_of(writer))
                except OSError as error:
                    self.head_error = f"{self._head}: {error}"
        except StoreError as error:
            self.head_error = f"{self._head}: {error}"


class AuditedTables(Tables):
    """Base class of the stores whose changes are recorded in the audit trail.

    Parameters
    ----------
    chain
        Audit trail, through which write transactions are opened.
    """

    def __init__(self, chain: AuditChain, reading: Reading) -> None:
        super().__init__(chain.writing, reading)
        self._audit = chain


class AuditStore(AuditedTables):
    """Store of the audit trail; other stores add audit entries to their transactions."""

    @property
    def chain(self) -> str:
        """Name of the chain: "padwatch" and "access" with SQLite, "postgresql" with PostgreSQL."""
        return self._audit.name

    @property
    def head_error(self) -> str | None:
        """Error of the last attempt to write the head file; None if it succeeded."""
        return self._audit.head_error

    def record(self, actions: Sequence[AuditAction]) -> None:
        """Write audit entries about actions that do not change the store; durable on return.

        Raises `StoreError` if the entries were not written.
        """
        with self._writing() as writer:
            self._audit.add(writer, actions)

    def entries(self, query: AuditQuery) -> list[AuditEntry]:
        """Return the audit entries that match a query, newest first."""
        with self._reading("replace") as reader:
            return [AuditEntry(*row) for row in reader.execute(SELECT, vars(query))]


def by_time(
    chains: Iterable[tuple[str, Iterable[AuditEntry]]], *, newest_first: bool = False
) -> Iterator[tuple[str, AuditEntry]]:
    """Merge the entries of several chains by time; yield pairs of chain name and entry.

    `chains` are pairs of a name and entries, oldest first, or newest first with `newest_first`.
    Entries of one chain keep their order, even if the clock was set back between them.
    """
    named = [zip(repeat(name), entries) for name, entries in chains]
    return merge(*named, key=lambda pair: pair[1].time_ns, reverse=newest_first)


class Trail:
    """Read-only access to one chain of the audit trail in a database that may be in use.

    Parameters
    ----------
    reading
        Function that opens a read-only transaction in which text is decoded without loss.
    head
        Head file, with the number and hash of the newest entry.
    is_shared
        Whether other hosts, each with its own head file, also write to the trail.
    """

    def __init__(self, reading: Connect, head: Path, *, is_shared: bool = False) -> None:
        self._reading, self._head, self._is_shared = reading, head, is_shared
        self.chain = chain_name(head)

    def verify(self) -> Verdict:
        """Verify the number and hash of each entry and the head file; return the result.

        Raises `StoreError` if the trail does not exist or cannot be read.
        """
        head = self._read_head()  # first: the head may lag behind the trail, but not lead
        with self._reading() as reader:
            last = newest_of(reader).number
            verdict = walk(
                _all(reader),
                head,
                lambda entry: place_of(entry, last),
                is_shared=self._is_shared,
            )
        if verdict.n_behind and self._read_head() == AuditHead(verdict.n_entries, verdict.hash):
            return replace(verdict, n_behind=0)  # entries were written in between
        return verdict

    @contextmanager
    def entries(self) -> Iterator[Iterator[AuditEntry]]:
        """Return a context manager that provides an iterator over all entries, oldest first.

        Raises `StoreError` if the trail does not exist or cannot be read.
        """
        with self._reading() as reader:
            yield _all(reader)

    def _read_head(self) -> AuditHead | str:
        try:
            return read_head(self._head)
        except HeadError as error:
            return str(error)


def _all(reader: Connection) -> Iterator[AuditEntry]:
    after = -(2**63)
    while rows := reader.execute(SELECT_NEXT, (after, PAGE)).fetchall():
        yield from (AuditEntry(*row) for row in rows)
        if rows[-1][0] <= after:  # a damaged index may form a loop
            return
        after = rows[-1][0]


def newest_of(reader: Connection) -> AuditHead:
    """Return the head of the stored trail: number and hash of its newest entry."""
    found = reader.execute(SELECT_NEWEST).fetchone()
    return AuditHead() if found is None else AuditHead(*found)


def begin_head(path: Path) -> None:
    """Write the head file of an empty trail; an existing file is kept.

    Raises `OSError` if the file cannot be written.
    """
    if not path.exists():
        write_head(path, AuditHead())


@contextmanager
def closed_after_error(database: Database, head: Path) -> Iterator[None]:
    """Return a context manager that closes a database after an error in its block.

    An `OSError` must be about the head file `head`; it is converted to `StoreError`.
    """
    try:
        yield
    except OSError as error:
        database.close()
        raise StoreError(f"the head file {head} cannot be written: {error.strerror}") from error
    except BaseException:
        database.close()
        raise


def _insert(writer: Connection, action: AuditAction, newest: AuditHead) -> AuditHead:
    entry = chained(action, newest.number + 1, newest.hash)
    writer.execute(INSERT, astuple(entry))
    return AuditHead(entry.number, entry.hash)


def _head_differed(action: AuditAction, newest: AuditHead, why: str) -> AuditAction:
    return AuditAction(
        time_ns=action.time_ns,
        actor="padwatch",
        action=HEAD_DIFFERED,
        object="audit",
        after=asdict(newest),
        reason=why,
    )


AUDIT_TABLES = """
    CREATE TABLE audit (
        number INTEGER PRIMARY KEY AUTOINCREMENT,
        time_ns INTEGER NOT NULL,
        actor TEXT NOT NULL,
        source TEXT NOT NULL CHECK (source IN ('api', 'command_line', 'padwatch')),
        peer TEXT,
        action TEXT NOT NULL,
        object TEXT NOT NULL,
        before TEXT,
        after TEXT,
        reason TEXT NOT NULL,
        previous_hash TEXT NOT NULL,
        hash TEXT NOT NULL
    ) STRICT;
    CREATE INDEX audit_of_actor ON audit (actor, number);
    CREATE INDEX audit_of_action ON audit (action, number);
    CREATE INDEX audit_of_object ON audit (object, number);
    CREATE TRIGGER audit_follows BEFORE INSERT ON audit
    WHEN NEW.number IS NOT (SELECT coalesce(max(number), 0) + 1 FROM audit)
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail follow one another'); END;
    CREATE TRIGGER audit_kept_as_told BEFORE UPDATE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept as they were written'); END;
    CREATE TRIGGER audit_kept BEFORE DELETE ON audit
    BEGIN SELECT RAISE(ABORT, 'entries of the audit trail are kept'); END;
"""
"""Migration that creates the table of audit entries."""
