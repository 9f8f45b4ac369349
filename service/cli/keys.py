"""`padwatch keys`: the keys with which machines come in."""

import json
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.api.auth.people import create_key
from service.cli.access import access_of, time_text
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.store.access.identities import MAX_DAYS, ApiKey, Role

app = typer.Typer(no_args_is_help=True, help="Keys of machines: create, list, revoke.")

JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command()
def create(
    plant_file: PlantPath,
    name: Annotated[str, typer.Argument(help="What it is for.", show_default=False)],
    role: Annotated[Role, typer.Option(help="What the machine is to the plant.")] = Role.VIEWER,
    unit: Annotated[
        list[str] | None, typer.Option(help="Open only this unit; may be repeated.")
    ] = None,
    days: Annotated[int, typer.Option(min=1, max=MAX_DAYS, help="Valid for so long.")] = 365,
    json_output: JsonOutput = False,
) -> None:
    """Create a key and print it: this once, nobody can show it again."""
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


@app.command("list")
def list_keys(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """List all keys that ever were; what they open is in them alone."""
    with access_of(read_plant_file(plant_file), "padwatch keys list") as access:
        keys = access.keys.all()
    now_ns = SystemClock().now_ns()
    if json_output:
        typer.echo(json.dumps([_row(key, now_ns) for key in keys]))
        return
    for key in keys:
        typer.echo(_line(key, now_ns))


@app.command()
def revoke(
    plant_file: PlantPath,
    id_: Annotated[str, typer.Argument(metavar="ID", help="As listed.", show_default=False)],
) -> None:
    """Take a key back for ever, from its next request on."""
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
