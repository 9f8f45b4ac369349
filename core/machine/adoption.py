"""What may change in the description of a unit while it is being watched, and what may not."""

from dataclasses import fields

from core.machine.unit import Bearing, Unit


def require_same_machine(here: Unit, there: Unit) -> None:
    """Refuse a description that differs in more than references, clearances and brackets.

    Raises
    ------
    ValueError
        Saying where, and giving both.
    """
    before, after = _fixed_parts(here), _fixed_parts(there)
    for name, value in before.items():
        if after[name] != value:
            raise ValueError(f"{name} is {after[name]!r}, is {value!r} here")


def bearings_with_new_references(here: Unit, there: Unit) -> list[str]:
    """Ids of the bearings whose gap references differ."""
    return [
        before.id
        for before, after in zip(here.bearings, there.bearings, strict=True)
        if _references(before) != _references(after)
    ]


def _fixed_parts(unit: Unit) -> dict[str, object]:
    """What stays as long as a monitor lives, by name."""
    fixed: dict[str, object] = {field.name: getattr(unit, field.name) for field in fields(unit)}
    return fixed | {"bearings": tuple((b.id, b.channels) for b in unit.bearings)}


def _references(bearing: Bearing) -> tuple[object, ...]:
    return (bearing.gap_reference_um, bearing.opposite_reference_um)
