"""`padwatch reference`: set and list references of the shaft centre."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from typing import Annotated, Any

import typer

from acquisition.clock import SystemClock
from core.machine.unit import Bearing
from service.api.routes.bearings import ReferenceModel, SetReferenceModel, reference_model
from service.app.storage import has_store
from service.cli.options import (
    JsonOutput,
    PlantPath,
    UnitOption,
    command_group,
    fail,
    one_unit,
    plant_store,
    print_result,
)
from service.live.commands import ReferenceRefusedError
from service.live.references import with_reference
from service.measuring.references import (
    Gaps,
    doubts,
    given_gaps,
    measured_gaps,
)
from service.runtime.process import person
from service.settings.core_values import machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.store.access.audit_entries import Acting, Source, acting_as
from service.store.references import GapReference, ReferenceSource


def _bearing_references(
    unit: str, bearing: Bearing, history: Sequence[GapReference]
) -> dict[str, Any]:
    """Return the reference of the shaft centre that applies to a bearing, and its earlier ones.

    Parameters
    ----------
    history
        Stored references of the bearing, newest first; if empty, that of the plant file applies.

    Returns
    -------
    dict
        Gaps that apply, [x, y] in µm, of the probes and of the opposite probes (None without
        opposite probes); their source and the history as models of the API.
    """
    newest = history[0] if history else None
    watched = bearing if newest is None else with_reference(bearing, newest)
    return {
        "unit": unit,
        "bearing": bearing.id,
        "gap_reference_um": watched.gap_reference_um,
        "opposite_reference_um": watched.opposite_reference_um,
        "reference": reference_model(newest),
        "history": [SetReferenceModel.of(reference) for reference in history],
    }


def _text_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line on the reference that applies in `found`, and one on each earlier reference."""
    gaps = _gaps(found["gap_reference_um"], found["opposite_reference_um"])
    yield f"{found['unit']} {found['bearing']}: {gaps}, {_source(found['reference'])}"
    for before in found["history"][1:]:
        gaps = _gaps(before.gap_reference_um, before.opposite_reference_um)
        yield f"  before: {gaps}, {_source(before)}"


def _gaps(near: Sequence[float], opposite: Sequence[float] | None) -> str:
    across = "" if opposite is None else f", opposite {_pair(opposite)}"
    return _pair(near) + across


def _pair(gaps_um: Sequence[float]) -> str:
    return f"{gaps_um[0]:.10g}, {gaps_um[1]:.10g} µm"


def _source(reference: ReferenceModel | SetReferenceModel) -> str:
    if reference.source == "plant_file":
        return "from the plant file"
    note = f": {reference.note}" if reference.note else ""
    return f"{reference.source}, set {reference.set} by {reference.author}{note}"


app = command_group("Set or list references: the probe gaps with the shaft centred.")

Gap = Annotated[float | None, typer.Option(help="Gap in µm, above 0 up to 10000.")]


@app.command("set")
def set_reference(
    plant_file: PlantPath,
    bearing: Annotated[str, typer.Option(help="Bearing of the unit.")],
    author: Annotated[str, typer.Option(help="Author of the reference, at most 80 characters.")],
    unit: UnitOption = None,
    x_um: Gap = None,
    y_um: Gap = None,
    opposite_x_um: Gap = None,
    opposite_y_um: Gap = None,
    measured: Annotated[
        bool, typer.Option("--measured", help="Take the mean gaps of the newest stored result.")
    ] = False,
    note: Annotated[str, typer.Option(help="Note, at most 500 characters.")] = "",
    json_output: JsonOutput = False,
) -> None:
    """Set the reference of a bearing from now on; a running service applies it within seconds.

    Earlier references are kept. Stored results do not change.
    """
    plant = load_plant_file(plant_file)
    machine = machine_of(one_unit(plant, unit, plant_file))
    found = _one_bearing(machine.bearings, bearing, machine.id)
    given = ((x_um, y_um), (opposite_x_um, opposite_y_um))
    if measured and given != ((None, None), (None, None)):
        fail("give gaps or --measured, not both", code=2)
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
        actor = Acting(Source.COMMAND_LINE, person())
        with acting_as(actor), plant_store(plant, creates=True) as store:
            store.gap_references.add(reference)
            history = store.gap_references.history(machine.id, found.id)
    except (ReferenceRefusedError, ValueError) as error:
        fail(f"unit {machine.id} bearing {found.id}: {error}", code=2)
    now = _bearing_references(machine.id, found, history)
    print_result(now, _text_lines(now), json_output)


@app.command("list")
def list_references(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """List the present and the earlier references of every bearing."""
    plant = load_plant_file(plant_file)
    with plant_store(plant) if has_store(plant) else nullcontext() as store:
        found = [
            _bearing_references(
                unit.id, bearing, store.gap_references.history(unit.id, bearing.id) if store else ()
            )
            for unit in plant.unit
            for bearing in machine_of(unit).bearings
        ]
    lines = (line for references in found for line in _text_lines(references))
    print_result(found, lines, json_output)


def _measured(plant: PlantFile, unit: str, bearing: Bearing) -> Gaps:
    with plant_store(plant) if has_store(plant) else nullcontext() as store:
        newest = store.newest(unit, bearing.id) if store else None
    gaps = measured_gaps(bearing, newest, SystemClock().now_ns())
    for doubt in doubts(newest) if newest else ():
        typer.echo(f"unit {unit} bearing {bearing.id}: {doubt}", err=True)
    return gaps


def _one_bearing(bearings: tuple[Bearing, ...], id_: str, unit: str) -> Bearing:
    chosen = [bearing for bearing in bearings if bearing.id == id_]
    if not chosen:
        known = ", ".join(bearing.id for bearing in bearings)
        fail(f"unit {unit}: unknown bearing {id_}; known bearings: {known}", code=2)
    return chosen[0]
