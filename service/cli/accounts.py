"""`padwatch users` and `padwatch keys`: accounts of people and keys of machines."""

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.api.auth.passwords import Hashing, PasswordRefusedError
from service.api.auth.people import People, create_key
from service.app.storage import has_store, open_store, store_name
from service.cli.options import PasswordFd, PlantPath, fail, password_from, read_plant_file
from service.runtime.process import made_by
from service.settings.plant import PlantFile
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.access.identities import MAX_DAYS, ApiKey, NameRefusedError, Role, account_name
from service.store.access.tables import AccessRefusedError, AccessStore
from service.store.port import StoreError

NS_PER_S = 1_000_000_000


@contextmanager
def access_of(plant: PlantFile, command: str, creates: bool = False) -> Iterator[AccessStore]:
    """Open the plant's accounts and keys; a refusal ends the command with one line.

    Parameters
    ----------
    creates
        Whether the database is created if there is none.
    """
    name = store_name(plant)
    if not has_store(plant):  # the data folder may be relative to another folder
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
    """Format a time in UTC, to the second."""
    return datetime.fromtimestamp(time_ns // NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


keys_app = typer.Typer(no_args_is_help=True, help="Keys of machines: create, list, revoke.")

JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@keys_app.command()
def create(
    plant_file: PlantPath,
    name: Annotated[str, typer.Argument(help="What it is for.", show_default=False)],
    role: Annotated[Role, typer.Option(help="What the machine is to the plant.")] = Role.VIEWER,
    unit: Annotated[
        list[str] | None, typer.Option(help="Open only this unit; may be repeated.")
    ] = None,
    days: Annotated[
        int, typer.Option(min=1, max=MAX_DAYS, help="Days until the key expires.")
    ] = 365,
    json_output: JsonOutput = False,
) -> None:
    """Create a key and print it; it cannot be shown again."""
    plant = read_plant_file(plant_file)
    known = [settings.id for settings in plant.unit]
    for wanted in unit or ():
        if wanted not in known:
            fail(f"padwatch keys create: there is no unit {wanted}, it has {', '.join(known)}", 2)
    with access_of(plant, "padwatch keys create", creates=True) as access:
        now_ns = SystemClock().now_ns()
        key, shown = create_key(access, name, role, unit or (), days, now_ns)
    if json_output:
        typer.echo(json.dumps({**_row(key, now_ns), "key": shown}))
        return
    typer.echo(shown)
    typer.echo(f"{_line(key, now_ns)}; the key is shown this once", err=True)


@keys_app.command("list")
def list_keys(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """List all keys, including expired and revoked ones, without their secrets."""
    with access_of(read_plant_file(plant_file), "padwatch keys list") as access:
        keys = access.keys.all()
    now_ns = SystemClock().now_ns()
    if json_output:
        typer.echo(json.dumps([_row(key, now_ns) for key in keys]))
        return
    for key in keys:
        typer.echo(_line(key, now_ns))


@keys_app.command()
def revoke(
    plant_file: PlantPath,
    id_: Annotated[str, typer.Argument(metavar="ID", help="As listed.", show_default=False)],
) -> None:
    """Revoke a key permanently, from its next request on."""
    with access_of(read_plant_file(plant_file), "padwatch keys revoke") as access:
        is_there = access.keys.get(id_) is not None
        is_news = is_there and access.keys.revoke(id_, SystemClock().now_ns())
    if not is_there:
        fail(f"padwatch keys revoke: there is no key {id_}", 2)
    typer.echo(f"{id_}: revoked" if is_news else f"{id_}: was revoked already")


def _row(key: ApiKey, now_ns: int) -> dict[str, object]:
    return {
        "id": key.id,
        "name": key.name,
        "role": key.role.value,
        "units": list(key.units),
        "state": key.state(now_ns).value,
        "created": time_text(key.created_ns),
        "expires": time_text(key.expires_ns),
        "used": None if key.used_ns is None else time_text(key.used_ns),
        "revoked": None if key.revoked_ns is None else time_text(key.revoked_ns),
    }


def _line(key: ApiKey, now_ns: int) -> str:
    units = ", ".join(key.units) or "all units"
    used = "never used" if key.used_ns is None else f"last used {time_text(key.used_ns)}"
    state = f"{key.state(now_ns)}, until {time_text(key.expires_ns)}"
    return f"{key.id} {key.name}: {key.role} of {units}, {state}, {used}"


users_app = typer.Typer(no_args_is_help=True, help="Accounts of people: add, list, change, remove.")

Name = Annotated[str, typer.Argument(help="Name of the account.", show_default=False)]
WantedRole = Annotated[Role, typer.Argument(help="What the account is to the plant.")]


@users_app.command()
def add(
    plant_file: PlantPath,
    name: Name,
    role: Annotated[Role, typer.Option(help="What the account is to the plant.")] = Role.VIEWER,
    password_fd: PasswordFd = None,
) -> None:
    """Add an account."""
    plant = read_plant_file(plant_file)
    password = password_from(password_fd, "padwatch users add")
    with access_of(plant, "padwatch users add", creates=True) as access:
        added = People(access, Hashing()).add(name, role, password, SystemClock().now_ns())
    typer.echo(f"{added}: added as {role}")


@users_app.command("list")
def list_users(
    plant_file: PlantPath,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print a JSON array instead of lines.")
    ] = False,
) -> None:
    """List accounts with their roles."""
    with access_of(read_plant_file(plant_file), "padwatch users list") as access:
        accounts = access.accounts.all()
    found = [
        {
            "name": account.name,
            "role": account.role.value,
            "created": time_text(account.created_ns),
            "password_set": time_text(account.password_ns),
        }
        for account in accounts
    ]
    if json_output:
        typer.echo(json.dumps(found))
        return
    for one in found:
        typer.echo("{name}: {role}, since {created}, password of {password_set}".format(**one))


@users_app.command("role")
def set_role(plant_file: PlantPath, name: Name, role: WantedRole) -> None:
    """Change the role of an account, from its next request on."""
    with access_of(read_plant_file(plant_file), "padwatch users role") as access:
        access.accounts.set_role(account_name(name), role, SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: is {role}")


@users_app.command("password")
def set_password(plant_file: PlantPath, name: Name, password_fd: PasswordFd = None) -> None:
    """Set another password and end all sessions of the account."""
    plant = read_plant_file(plant_file)
    password = password_from(password_fd, "padwatch users password")
    with access_of(plant, "padwatch users password") as access:
        people = People(access, Hashing())
        people.set_password(account_name(name), password, SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: has a new password, its sessions are ended")


@users_app.command()
def remove(plant_file: PlantPath, name: Name) -> None:
    """Remove an account and end its sessions."""
    with access_of(read_plant_file(plant_file), "padwatch users remove") as access:
        access.accounts.remove(account_name(name), SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: removed")
