"""`padwatch audit`: verify the audit trail, and export it as a file."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from service.api.tables import write_csv
from service.app.storage import open_trails
from service.cli.options import JsonOutput, PlantPath, argument, command_group, fail, print_result
from service.settings.plant import load_plant_file
from service.store.access.audit_verification import Verdict
from service.store.audit import by_time

app = command_group("Verify and export the audit trail.")


@app.command()
def verify(
    plant_file: PlantPath,
    known: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CHAIN:NUMBER",
            help="Entry that reports a restored backup; may be given several times.",
        ),
    ] = None,
    json_output: JsonOutput = False,
) -> None:
    """Check that no entry of the audit trail is altered, missing or out of order.

    Prints the first wrong entry of each chain of entries, and compares the last entry with the head
    file beside the database. The service may keep running. Exit code 1 if anything is wrong.
    """
    trails = open_trails(load_plant_file(plant_file))
    chains, lines = {}, []
    unmatched = set(known or ())
    for trail in trails:
        verdict = trail.verify()
        numbers = verdict.contradictions
        unknown = [n for n in numbers if f"{trail.chain}:{n}" not in (known or ())]
        unmatched -= {f"{trail.chain}:{n}" for n in numbers}
        is_whole = verdict.is_whole and not unknown
        chains[trail.chain] = {"is_whole": is_whole} | asdict(verdict) | {"contradictions": unknown}
        lines += [f"{trail.chain}: {line}" for line in _lines(trail.chain, verdict, unknown)]
    if unmatched:
        fail(f"--known {min(unmatched)}: no such entry reports a restored backup", code=2)
    are_whole = all(chain["is_whole"] for chain in chains.values())
    print_result({"is_whole": are_whole, "chains": chains}, lines, json_output)
    if not are_whole:
        raise typer.Exit(1)


@app.command()
def export(
    plant_file: PlantPath,
    out: Annotated[Path, argument("CSV file to write; must not exist yet.")],
) -> None:
    """Write the whole audit trail, oldest first, as a CSV file that spreadsheets read as text."""
    trails = open_trails(load_plant_file(plant_file))
    if out.suffix != ".csv":
        fail(f"{out}: the name of the file must end in .csv", code=2)
    try:
        with ExitStack() as stack:
            chains = [(trail.chain, stack.enter_context(trail.entries())) for trail in trails]
            file = stack.enter_context(out.open("x", encoding="utf-8", newline=""))
            n_entries = write_csv(file, by_time(chains))
    except OSError as error:
        fail(f"{out}: {error.strerror}")
    typer.echo(f"{out}: {n_entries} entries")


def _lines(chain: str, verdict: Verdict, unknown: Sequence[int]) -> Iterator[str]:
    yield f"{verdict.n_entries} entries are intact; the hash of the last is {verdict.hash}"
    if verdict.finding is not None:
        yield f"CORRUPT: {verdict.finding.detail}"
    if verdict.n_behind and verdict.is_shared:
        yield (
            f"the head file of this host names entry {verdict.n_entries - verdict.n_behind}; the"
            f" {verdict.n_behind} later entries are of other hosts, or of this one before a crash"
        )
    elif verdict.n_behind:
        yield f"the head file is {verdict.n_behind} entries behind; the next entry updates it"
    for number in unknown:
        yield (
            f"CORRUPT: entry {number} reports that the head file did not match the trail"
            f" (--known {chain}:{number} for a restored backup)"
        )
