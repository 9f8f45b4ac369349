"""Bringing a PostgreSQL database to the newest schema."""

from service.settings.storage import Origin
from service.store import schema
from service.store.port import StoreError
from service.store.postgres.connection import Session
from service.store.postgres.locks import MIGRATING
from service.store.postgres.schema import HAS_TIMESCALE, HYPERTABLE, WHAT, statements_to

HAS_WHAT = "SELECT to_regclass(quote_ident(current_schema()) || '.padwatch') IS NOT NULL"
N_TABLES = """
    SELECT count(*) FROM pg_class WHERE relnamespace = quote_ident(current_schema())::regnamespace
    AND relkind IN ('r', 'p', 'v', 'm', 'f')
    AND NOT EXISTS (SELECT 1 FROM pg_depend WHERE objid = pg_class.oid AND deptype = 'e')
"""


def migrate(session: Session, where: str, origin: Origin) -> None:
    """Bring a database to the newest schema, all of it or nothing; one process at a time.

    Raises
    ------
    StoreError
        If the database belongs to another program, to a newer padwatch, or to the other origin.
    """
    with session.transaction():
        session.execute("SELECT pg_advisory_xact_lock(%s)", (MIGRATING,))
        before = _schema_number(session, where, origin)
        newest = len(schema.MIGRATIONS)
        if before > newest:
            raise StoreError(
                f"{where} has schema {before}, this padwatch knows up to {newest};"
                " run the padwatch that wrote it, or restore a backup"
            )
        for number in range(before + 1, newest + 1):
            for statement in statements_to(number):
                session.execute(statement.encode())
        if before < newest:
            session.execute("UPDATE padwatch SET schema_number = %s", (newest,))
        if before == 0 and session.execute(HAS_TIMESCALE).fetchone():
            session.execute(HYPERTABLE)


def _schema_number(session: Session, where: str, origin: Origin) -> int:
    """Number of the schema that there is; the database is marked as padwatch's if it is new."""
    if session.execute(HAS_WHAT).fetchone() == (True,):
        row = session.execute("SELECT origin, schema_number FROM padwatch").fetchone()
        if row is None:
            raise StoreError(f"{where} does not say what it holds; restore a backup")
        if row[0] != origin.value:
            raise StoreError(
                f"{where} holds {row[0]} results and is not opened for {origin} ones;"
                " choose another database"
            )
        return int(row[1])
    found = session.execute(N_TABLES).fetchone()
    if found is None or found[0]:
        raise StoreError(f"{where} is not a padwatch database; create one for padwatch alone")
    session.execute(WHAT)
    session.execute("INSERT INTO padwatch (origin, schema_number) VALUES (%s, 0)", (origin.value,))
    return 0
