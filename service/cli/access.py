"""What commands about accounts and keys share: the plant's database, refusals, times."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime

import typer

from service.api.auth.passwords import PasswordRefusedError
from service.app.stores import has_store, open_store, store_name
from service.cli.plant_file import fail
from service.runtime.process import made_by
from service.settings.plant import PlantFile
from service.store.access.acting import Acting, acting_as
from service.store.access.audit_entry import Source
from service.store.access.names import NameRefusedError
from service.store.access.port import AccessRefusedError, AccessStore
from service.store.port import StoreError

NS_PER_S = 1_000_000_000


@contextmanager
def access_of(plant: PlantFile, command: str, creates: bool = False) -> Iterator[AccessStore]:
    """The plant's accounts and keys; what is refused ends the command with one line.

    Parameters
    ----------
    creates
        Whether the database is created if there is none.
    """
    name = store_name(plant)
    if not has_store(plant):  # its folder may be relative to another one than this
        if not creates:
            fail(f"{command}: {name}: there is no such database")
        typer.echo(f"{name}: a new database; is that where the service runs?", err=True)
    who = Acting(Source.COMMAND_LINE, made_by())
    try:
        with acting_as(who), closing(open_store(plant)) as store:
            yield store.access
    except (AccessRefusedError, NameRefusedError, PasswordRefusedError) as error:
        fail(f"{command}: {error}", 2)
    except StoreError as error:
        fail(f"{command}: {error}")


def time_text(time_ns: int) -> str:
    """UTC, to the second."""
    return datetime.fromtimestamp(time_ns // NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
