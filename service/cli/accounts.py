"""`padwatch users` and `padwatch keys`: accounts of people and keys of machines."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from core.units import NS_PER_S
from service.api.auth.authenticator import Authenticator
from service.cli.options import (
    JsonOutput,
    PasswordFd,
    PlantPath,
    argument,
    command_group,
    fail,
    password_from,
    plant_access,
    print_result,
)
from service.runtime.process import made_by
from service.settings.plant import PlantFile, load_plant_file
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.access.identities import MAX_DAYS, ApiKey, Role, account_name
from service.store.access.tables import AccessStore


@contextmanager
def access_of(plant: PlantFile, creates: bool = False) -> Iterator[AccessStore]:
    """Open the plant's accounts and keys, yield their store, and close it.

    Audit entries made in the block have the command line as their source. With `creates`, a missing
    database is created; otherwise it raises `CommandError`.
    """
    with acting_as(Acting(Source.COMMAND_LINE, made_by())), plant_access(plant, creates) as store:
        yield store


def _time_text(time_ns: int) -> str:
    """Return a time, ns since 1970 UTC, as RFC 3339 text, truncated to the second."""
    return datetime.fromtimestamp(time_ns // NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


keys_app = command_group("API keys: create, list, revoke.")


@keys_app.command()
def create(
    plant_file: PlantPath,
    name: Annotated[str, argument("Purpose of the key.")],
    role: Annotated[Role, typer.Option(help="Role of the machine.")] = Role.VIEWER,
    unit: Annotated[
        list[str] | None, typer.Option(help="Limit the key to this unit; may be repeated.")
    ] = None,
    days: Annotated[
        int, typer.Option(min=1, max=MAX_DAYS, help="Days until the key expires.")
    ] = 365,
    json_output: JsonOutput = False,
) -> None:
    """Create a key and print it; it cannot be shown again."""
    plant = load_plant_file(plant_file)
    known = [settings.id for settings in plant.unit]
    for wanted in unit or ():
        if wanted not in known:
            fail(f"unknown unit {wanted}; known units: {', '.join(known)}", 2)
    with access_of(plant, creates=True) as access:
        people = Authenticator(access, SystemClock())
        key, shown = people.create_key(name, role, unit or (), days)
    now_ns = key.created_ns
    print_result({**_row(key, now_ns), "key": shown}, [shown], json_output, indent=None)
    if not json_output:
        typer.echo(f"{_line(key, now_ns)}; the key is shown only once", err=True)


@keys_app.command("list")
def list_keys(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """List all keys, including expired and revoked ones, without their secrets."""
    with access_of(load_plant_file(plant_file)) as access:
        keys = access.keys.all()
    now_ns = SystemClock().now_ns()
    rows, lines = [_row(key, now_ns) for key in keys], [_line(key, now_ns) for key in keys]
    print_result(rows, lines, json_output, indent=None)


@keys_app.command()
def revoke(
    plant_file: PlantPath,
    id_: Annotated[str, argument("Id of the key, as listed.", metavar="ID")],
) -> None:
    """Revoke a key permanently; it is rejected from the next request on."""
    with access_of(load_plant_file(plant_file)) as access:
        if access.keys.get(id_) is None:
            fail(f"key {id_} does not exist; run `padwatch keys list` for the ids", 2)
        is_new = access.keys.revoke(id_, SystemClock().now_ns())
    typer.echo(f"{id_}: revoked" if is_new else f"{id_}: was already revoked")


def _row(key: ApiKey, now_ns: int) -> dict[str, object]:
    return {
        "id": key.id,
        "name": key.name,
        "role": key.role.value,
        "units": list(key.units),
        "state": key.state(now_ns).value,
        "created": _time_text(key.created_ns),
        "expires": _time_text(key.expires_ns),
        "used": None if key.used_ns is None else _time_text(key.used_ns),
        "revoked": None if key.revoked_ns is None else _time_text(key.revoked_ns),
    }


def _line(key: ApiKey, now_ns: int) -> str:
    units = ", ".join(key.units) or "all units"
    used = "never used" if key.used_ns is None else f"last used {_time_text(key.used_ns)}"
    state = f"{key.state(now_ns)}, until {_time_text(key.expires_ns)}"
    return f"{key.id} {key.name}: {key.role} of {units}, {state}, {used}"


users_app = command_group("Accounts of people: add, list, change, remove.")

Name = Annotated[str, argument("Name of the account.")]


@users_app.command()
def add(
    plant_file: PlantPath,
    name: Name,
    role: Annotated[Role, typer.Option(help="Role of the account.")] = Role.VIEWER,
    password_fd: PasswordFd = None,
) -> None:
    """Add an account, with a password from the prompt or from --password-fd."""
    plant, password = load_plant_file(plant_file), password_from(password_fd)
    with access_of(plant, creates=True) as access:
        added = Authenticator(access, SystemClock()).add(name, role, password)
    typer.echo(f"{added}: added as {role}")


@users_app.command("list")
def list_users(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """List accounts with their roles."""
    with access_of(load_plant_file(plant_file)) as access:
        accounts = access.accounts.all()
    rows = [
        {
            "name": account.name,
            "role": account.role.value,
            "created": _time_text(account.created_ns),
            "password_set": _time_text(account.password_ns),
        }
        for account in accounts
    ]
    line = "{name}: {role}, since {created}, password of {password_set}"
    print_result(rows, [line.format(**row) for row in rows], json_output, indent=None)


@users_app.command("role")
def set_role(
    plant_file: PlantPath,
    name: Name,
    role: Annotated[Role, typer.Argument(help="New role of the account.")],
) -> None:
    """Change the role of an account; it applies from the next request on."""
    with access_of(load_plant_file(plant_file)) as access:
        access.accounts.set_role(account_name(name), role, SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: role changed to {role}")


@users_app.command("password")
def set_password(plant_file: PlantPath, name: Name, password_fd: PasswordFd = None) -> None:
    """Set a new password for an account and end all its sessions."""
    plant, password = load_plant_file(plant_file), password_from(password_fd)
    with access_of(plant) as access:
        Authenticator(access, SystemClock()).set_password(account_name(name), password)
    typer.echo(f"{account_name(name)}: password changed, all sessions ended")


@users_app.command()
def remove(plant_file: PlantPath, name: Name) -> None:
    """Remove an account and end its sessions."""
    with access_of(load_plant_file(plant_file)) as access:
        access.accounts.remove(account_name(name), SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: removed")
