"""The reference of a bearing and those before it, for people and for programs."""

from collections.abc import Iterator, Sequence

from core.machine.unit import Bearing
from service.api.routes.bearings import ReferenceModel, reference_model
from service.api.routes.references import SetReferenceModel, set_reference_model
from service.api.values import ApiModel
from service.measuring.references import with_reference
from service.store.gap_reference import GapReference


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
    """What the plant file and what was set since say of a bearing's reference.

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
    """A line for the reference in force, and one for each before it."""
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
