"""`padwatch users`: the accounts of people."""

import json
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.api.auth.passwords import Hashing
from service.api.auth.people import People
from service.cli.access import access_of, time_text
from service.cli.passwords import PasswordFd, password_from
from service.cli.plant_file import PlantPath, read_plant_file
from service.store.access.identities import Role, account_name

app = typer.Typer(no_args_is_help=True, help="Accounts of people: add, list, change, remove.")

Name = Annotated[str, typer.Argument(help="Name of the account.", show_default=False)]
WantedRole = Annotated[Role, typer.Argument(help="What the account is to the plant.")]


@app.command()
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


@app.command("list")
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


@app.command("role")
def set_role(plant_file: PlantPath, name: Name, role: WantedRole) -> None:
    """Change the role of an account, from its next request on."""
    with access_of(read_plant_file(plant_file), "padwatch users role") as access:
        access.accounts.set_role(account_name(name), role, SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: is {role}")


@app.command("password")
def set_password(plant_file: PlantPath, name: Name, password_fd: PasswordFd = None) -> None:
    """Set another password; everybody who is logged in to the account is logged out."""
    plant = read_plant_file(plant_file)
    password = password_from(password_fd, "padwatch users password")
    with access_of(plant, "padwatch users password") as access:
        people = People(access, Hashing())
        people.set_password(account_name(name), password, SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: has a new password, its sessions are ended")


@app.command()
def remove(plant_file: PlantPath, name: Name) -> None:
    """Remove an account; whoever is logged in to it is logged out."""
    with access_of(read_plant_file(plant_file), "padwatch users remove") as access:
        access.accounts.remove(account_name(name), SystemClock().now_ns())
    typer.echo(f"{account_name(name)}: removed")
