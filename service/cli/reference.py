"""`padwatch reference`: set and list references of the shaft centre."""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Annotated

import typer
from pydantic import TypeAdapter

from acquisition.clock import SystemClock
from core.machine.unit import Bearing
from service.api.routes.bearings import ReferenceModel, reference_model
from service.api.routes.references import SetReferenceModel, set_reference_model
from service.api.values import ApiModel
from service.app.storage import has_store, open_store, store_name
from service.cli.options import PlantPath, UnitOption, fail, one_unit, read_plant_file
from service.measuring.references_in_force import (
    Gaps,
    ReferenceRefusedError,
    doubts,
    given_gaps,
    measured_gaps,
    with_reference,
)
from service.runtime.process import person
from service.settings.core_values import machine_of
from service.settings.plant import PlantFile
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource
from service.store.store import Store


class BearingReferences(ApiModel):
    """A bearing's references; the parts are those of the API."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    gap_reference_um: list[float]
    """Probe gaps [x, y] with the shaft centred, as in force."""

    opposite_reference_um: list[float] | None
    """The same of the probes across the shaft."""

    reference: ReferenceModel
    """Where these gaps come from."""

    history: list[SetReferenceModel]
    """All that were set, newest first."""


def bearing_references(
    unit: str, bearing: Bearing, history: Sequence[GapReference]
) -> BearingReferences:
    """Return a bearing's reference in force, from the plant file or set since, and its history.

    Parameters
    ----------
    history
        Newest first.
    """
    newest = history[0] if history else None
    watched = bearing if newest is None else with_reference(bearing, newest)
    opposite = watched.opposite_reference_um
    return BearingReferences(
        unit=unit,
        bearing=bearing.id,
        gap_reference_um=list(watched.gap_reference_um),
        opposite_reference_um=None if opposite is None else list(opposite),
        reference=reference_model(newest),
        history=[set_reference_model(reference) for reference in history],
    )


def text_lines(found: BearingReferences) -> Iterator[str]:
    """Yield a line for the reference in force, and one for each earlier reference."""
    gaps = _gaps(found.gap_reference_um, found.opposite_reference_um)
    said = found.reference
    yield f"{found.unit} {found.bearing}: {gaps}, {_words(said)}"
    for before in found.history[1:]:
        gaps = _gaps(before.gap_reference_um, before.opposite_reference_um)
        yield f"  before: {gaps}, {_words(before)}"


def _gaps(near: list[float], opposite: list[float] | None) -> str:
    across = "" if opposite is None else f", opposite {_pair(opposite)}"
    return _pair(near) + across


def _pair(gaps_um: list[float]) -> str:
    return f"{gaps_um[0]:.10g}, {gaps_um[1]:.10g} µm"


def _words(said: ReferenceModel | SetReferenceModel) -> str:
    if said.source == "plant_file":
        return "from the plant file"
    note = f": {said.note}" if said.note else ""
    return f"{said.source}, set {said.set} by {said.author}{note}"


app = typer.Typer(
    no_args_is_help=True, help="Set or list references: the probe gaps with the shaft centred."
)

Gap = Annotated[float | None, typer.Option(help="Gap in µm, above 0 up to 10000.")]


@app.command("set")
def set_reference(
    plant_file: PlantPath,
    bearing: Annotated[str, typer.Option(help="Bearing of the unit.")],
    author: Annotated[str, typer.Option(help="Who sets it, at most 80 characters.")],
    unit: UnitOption = None,
    x_um: Gap = None,
    y_um: Gap = None,
    opposite_x_um: Gap = None,
    opposite_y_um: Gap = None,
    measured: Annotated[
        bool, typer.Option("--measured", help="Take the mean gaps of the newest stored result.")
    ] = False,
    note: Annotated[str, typer.Option(help="At most 500 characters.")] = "",
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Set the reference of a bearing, from now on; a running service takes it over in seconds.

    Earlier references are kept. Results that are stored already do not change.
    """
    plant = read_plant_file(plant_file)
    machine = machine_of(one_unit(plant, unit, plant_file))
    found = _one_bearing(machine.bearings, bearing, machine.id)
    given = ((x_um, y_um), (opposite_x_um, opposite_y_um))
    if measured and given != ((None, None), (None, None)):
        fail("padwatch reference set: give gaps or --measured, not both", code=2)
    try:
        gaps = _measured(plant, machine.id, found) if measured else given_gaps(found, *given)
        reference = GapReference(
            unit=machine.id,
            bearing=found.id,
            set_ns=SystemClock().now_ns(),
            author=author.strip(),
            gap_reference_um=gaps[0],
            opposite_reference_um=gaps[1],
            source=ReferenceSource.MEASURED if measured else ReferenceSource.GIVEN,
            note=note.strip(),
        )
        now = bearing_references(machine.id, found, _add(plant, reference))
    except (ReferenceRefusedError, ValueError) as error:
        fail(f"padwatch reference set: unit {machine.id} bearing {found.id}: {error}", code=2)
    except StoreError as error:
        fail(f"padwatch reference set: {error}")
    typer.echo(now.model_dump_json(indent=1) if json_output else "\n".join(text_lines(now)))


@app.command("list")
def list_references(
    plant_file: PlantPath,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print a JSON array instead of lines.")
    ] = False,
) -> None:
    """List the reference in force of every bearing, and those before it."""
    plant = read_plant_file(plant_file)
    try:
        found = list(_all_references(plant))
    except StoreError as error:
        fail(f"padwatch reference list: {error}")
    if json_output:
        typer.echo(TypeAdapter(list[BearingReferences]).dump_json(found, indent=1).decode())
    else:
        typer.echo("\n".join(line for references in found for line in text_lines(references)))


def _all_references(plant: PlantFile) -> Iterator[BearingReferences]:
    with _existing_store(plant) as store:
        for settings in plant.unit:
            machine = machine_of(settings)
            for bearing in machine.bearings:
                history = store.reference_history(machine.id, bearing.id) if store else ()
                yield bearing_references(machine.id, bearing, history)


def _add(plant: PlantFile, reference: GapReference) -> Sequence[GapReference]:
    """Store a reference and return its bearing's history."""
    if not has_store(plant):  # the data folder may be relative to another folder
        typer.echo(
            f"{store_name(plant)}: a new database; is that where the service runs?", err=True
        )
    who = Acting(Source.COMMAND_LINE, person())
    with acting_as(who), closing(open_store(plant)) as store:
        store.add_reference(reference)
        return store.reference_history(reference.unit, reference.bearing)


@contextmanager
def _existing_store(plant: PlantFile) -> Iterator[Store | None]:
    """Open the plant's database, or yield None if it does not exist, without creating it."""
    if not has_store(plant):
        yield None
        return
    with closing(open_store(plant)) as store:
        yield store


def _measured(plant: PlantFile, unit: str, bearing: Bearing) -> Gaps:
    with _existing_store(plant) as store:
        newest = store.newest(unit, bearing.id) if store else None
    gaps = measured_gaps(bearing, newest, SystemClock().now_ns())
    for doubt in doubts(newest) if newest else ():
        typer.echo(f"unit {unit} bearing {bearing.id}: {doubt}", err=True)
    return gaps


def _one_bearing(bearings: tuple[Bearing, ...], id_: str, unit: str) -> Bearing:
    chosen = [bearing for bearing in bearings if bearing.id == id_]
    if not chosen:
        known = ", ".join(bearing.id for bearing in bearings)
        fail(f"padwatch reference set: unit {unit} has no bearing {id_}, it has {known}", code=2)
    return chosen[0]
