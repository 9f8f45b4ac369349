"""`padwatch audit`: verify the audit trail, and export it as a file."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from pydantic import TypeAdapter

from service.api.audit_csv import write_csv
from service.app.storage import open_trail
from service.cli.options import PlantPath, fail, read_plant_file
from service.store.access.audit_verification import Verdict
from service.store.port import StoreError

app = typer.Typer(no_args_is_help=True, help="The audit trail: who did what to what.")


@app.command()
def verify(
    plant_file: PlantPath,
    known: Annotated[
        list[int] | None,
        typer.Option(help="Entry that tells of a restored backup; may be given several times."),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Walk the audit trail; exit code 1 if anything in it is altered, missing or out of order.

    The service may go on running. Names the first entry that is wrong, and compares the last with
    the file beside the database.
    """
    trail = open_trail(read_plant_file(plant_file))
    try:
        verdict = trail.verify()
    except StoreError as error:
        fail(f"padwatch audit verify: {error}")
    told = [number for number in verdict.contradictions if number not in (known or [])]
    is_whole = verdict.is_whole and not told
    if json_output:
        document = {"is_whole": is_whole, **asdict(verdict), "told": told}
        typer.echo(TypeAdapter(dict[str, object]).dump_json(document, indent=1).decode())
    else:
        typer.echo("\n".join(_lines(verdict, told)))
    if not is_whole:
        raise typer.Exit(1)


@app.command()
def export(
    plant_file: PlantPath,
    out: Annotated[Path, typer.Argument(help="CSV file to write, a new one.", show_default=False)],
) -> None:
    """Write the whole audit trail, oldest first, as a CSV file that spreadsheets take for text."""
    trail = open_trail(read_plant_file(plant_file))
    if out.suffix != ".csv":
        fail(f"padwatch audit export: {out}: must end in .csv", code=2)
    try:
        with trail.entries() as entries, out.open("x", encoding="utf-8", newline="") as file:
            n_entries = write_csv(file, entries)
    except StoreError as error:
        fail(f"padwatch audit export: {error}")
    except OSError as error:
        fail(f"padwatch audit export: {out}: {error.strerror}")
    typer.echo(f"{out}: {n_entries} entries")


def _lines(verdict: Verdict, told: list[int]) -> list[str]:
    lines = [f"{verdict.n_entries} entries are whole; the last has the hash {verdict.hash}"]
    if verdict.finding is not None:
        lines.append(f"NOT WHOLE: {verdict.finding.detail}")
    if verdict.n_behind and verdict.is_shared:
        lines.append(
            f"the head of this host names entry {verdict.n_entries - verdict.n_behind}; the"
            f" {verdict.n_behind} after it are other hosts', or this one's just before a crash"
        )
    elif verdict.n_behind:
        lines.append(
            f"the head lags by {verdict.n_behind}, as after a crash; the next entry repairs it"
        )
    lines += [
        f"NOT WHOLE: entry {number} tells that the head did not fit the trail"
        " (--known for a restored backup)"
        for number in told
    ]
    return lines
