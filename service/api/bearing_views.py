"""From bearings and their references to what the API says of them."""

from core.machine.unit import Bearing
from service.api.bearing_models import BearingModel, ReferenceModel, SetReferenceModel
from service.runtime.times import rfc3339
from service.store.gap_reference import GapReference


def bearing_model(unit: str, bearing: Bearing, reference: GapReference | None) -> BearingModel:
    """A bearing as it is watched.

    Parameters
    ----------
    reference
        The stored one, if it is in force.
    """
    opposite = bearing.opposite_reference_um
    return BearingModel(
        unit=unit,
        id=bearing.id,
        bracket_stiffness_n_per_m=bearing.bracket_stiffness_n_per_m,
        clearance_um=bearing.clearance_um,
        gap_reference_um=list(bearing.gap_reference_um),
        opposite_reference_um=None if opposite is None else list(opposite),
        reference=reference_model(reference),
        channels={
            "shaft_x": bearing.shaft_x,
            "shaft_y": bearing.shaft_y,
            "bearing_x": bearing.bearing_x,
            "bearing_y": bearing.bearing_y,
        },
    )


def reference_model(reference: GapReference | None) -> ReferenceModel:
    """Where a reference comes from; None is the plant file."""
    if reference is None:
        return ReferenceModel(source="plant_file", set=None, author=None, note=None)
    return ReferenceModel(
        source=reference.source.value,
        set=rfc3339(reference.set_ns),
        author=reference.author,
        note=reference.note or None,
    )


def set_reference_model(reference: GapReference) -> SetReferenceModel:
    """A reference as it was set."""
    opposite = reference.opposite_reference_um
    return SetReferenceModel(
        gap_reference_um=list(reference.gap_reference_um),
        opposite_reference_um=None if opposite is None else list(opposite),
        source=reference.source.value,
        set=rfc3339(reference.set_ns),
        author=reference.author,
        note=reference.note or None,
    )
