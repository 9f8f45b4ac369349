"""`padwatch audit`: verify the audit trail, and export it as a file."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from service.api.audit_csv import write_csv
from service.app.storage import open_trail
from service.cli.options import JsonOutput, PlantPath, argument, command_group, fail, print_result
from service.settings.loading import load_plant_file
from service.store.access.audit_verification import Verdict

app = command_group("Verify and export the audit trail.")


@app.command()
def verify(
    plant_file: PlantPath,
    known: Annotated[
        list[int] | None,
        typer.Option(help="Entry that reports a restored backup; may be given several times."),
    ] = None,
    json_output: JsonOutput = False,
) -> None:
    """Verify the audit trail; exit code 1 if an entry is altered, missing or out of order.

    The service may keep running. Names the first wrong entry, and compares the last entry with the
    file beside the database.
    """
    verdict = open_trail(load_plant_file(plant_file)).verify()
    unknown = [number for number in verdict.contradictions if number not in (known or [])]
    is_whole = verdict.is_whole and not unknown
    document = {"is_whole": is_whole, **asdict(verdict), "contradictions": unknown}
    print_result(document, _lines(verdict, unknown), json_output)
    if not is_whole:
        raise typer.Exit(1)


@app.command()
def export(
    plant_file: PlantPath,
    out: Annotated[Path, argument("CSV file to write; must not exist yet.")],
) -> None:
    """Write the whole audit trail, oldest first, as a CSV file that spreadsheets read as text."""
    trail = open_trail(load_plant_file(plant_file))
    if out.suffix != ".csv":
        fail(f"{out}: must end in .csv", code=2)
    try:
        with trail.entries() as entries, out.open("x", encoding="utf-8", newline="") as file:
            n_entries = write_csv(file, entries)
    except OSError as error:
        fail(f"{out}: {error.strerror}")
    typer.echo(f"{out}: {n_entries} entries")


def _lines(verdict: Verdict, unknown: list[int]) -> Iterator[str]:
    yield f"{verdict.n_entries} entries are intact; the hash of the last is {verdict.hash}"
    if verdict.finding is not None:
        yield f"CORRUPT: {verdict.finding.detail}"
    if verdict.n_behind and verdict.is_shared:
        yield (
            f"the head of this host names entry {verdict.n_entries - verdict.n_behind}; the"
            f" {verdict.n_behind} later entries are of other hosts, or of this one before a crash"
        )
    elif verdict.n_behind:
        yield f"the head is {verdict.n_behind} entries behind; the next entry repairs it"
    for number in unknown:
        yield (
            f"CORRUPT: entry {number} reports that the head did not match the trail"
            " (--known for a restored backup)"
        )
