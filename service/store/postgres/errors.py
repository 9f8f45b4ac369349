"""Errors of PostgreSQL as sentences that say what to do."""

from collections.abc import Iterator
from contextlib import contextmanager

import psycopg

from service.store.port import RefusedRowError, StoreError

BY_STATE = {
    "53100": "the disk of the database is full: make room there",
    "53200": "the database server has no memory left",
    "53300": "too many connections are open: raise max_connections",
    "57014": "it took too long: the database is too slow, or too busy with others",
    "55P03": "another padwatch has been writing for too long: see what it waits for",
    "25P03": "a transaction was left open for too long",
    "25006": "the database only reads: name the primary in [store] postgresql, not a standby",
    "42501": "the role may not do this: give it the rights that the how-to of PostgreSQL lists",
    "57P01": "the database server is being stopped; it is tried again",
    "57P02": "the database server has crashed and recovers; it is tried again",
    "57P03": "the database server is starting or stopping; it is tried again",
    "XX001": "the database is damaged: restore a backup",
    "XX002": "an index is damaged: run reindexdb",
}
"""What to do, by SQLSTATE."""

BY_WORDS = {
    "password authentication failed": "correct [store] password_file, or the role's password",
    "no password supplied": "name a [store] password_file",
    "no pg_hba.conf entry": "let this host and role in, in pg_hba.conf of the server",
    "does not exist": "create it, as the how-to of PostgreSQL shows, or correct [store] postgresql",
    "too many clients": BY_STATE["53300"],
    "remaining connection slots": BY_STATE["53300"],
    "the database system is": BY_STATE["57P03"],
    "could not translate host name": "correct the host in [store] postgresql",
    "session is read-only": BY_STATE["25006"],
    "certificate": "correct sslmode, sslrootcert or sslcert in [store] postgresql",
}
"""What to do, by what the server or its library says before there is a session."""

OF_THE_ROW = (
    psycopg.IntegrityError,
    psycopg.DataError,
    psycopg.errors.DataCorrupted,
    psycopg.errors.IndexCorrupted,
)
"""Errors that a row or its page is to blame for: others of its transaction can be written."""

UNREACHABLE = "see whether PostgreSQL runs and can be reached; it is tried again"


def sentence(where: str, error: psycopg.Error) -> str:
    """What went wrong where, and what to do about it."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    said = (error.diag.message_primary or (lines[0] if lines else type(error).__name__)).rstrip(".")
    advice = _advice(error)
    return f"{where}: {said}" + (f"; {advice}" if advice else "")


def _advice(error: psycopg.Error) -> str | None:
    if error.sqlstate in BY_STATE:
        return BY_STATE[error.sqlstate]
    if error.sqlstate is None and isinstance(error, psycopg.OperationalError):
        said = str(error)
        return next((advice for words, advice in BY_WORDS.items() if words in said), UNREACHABLE)
    return None


@contextmanager
def renamed(where: str) -> Iterator[None]:
    """Raise `StoreError` for whatever PostgreSQL, its library or the system raise."""
    try:
        yield
    except psycopg.Error as error:
        kind = RefusedRowError if isinstance(error, OF_THE_ROW) else StoreError
        raise kind(sentence(where, error)) from error
    except UnicodeEncodeError as error:
        raise RefusedRowError(f"{where}: {error}") from error
    except OSError as error:
        raise StoreError(f"{where}: {error}") from error
