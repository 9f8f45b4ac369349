"""A bearing's reference: the probe gaps with the shaft centred, who said so and when."""

from dataclasses import dataclass
from enum import StrEnum

MAX_GAP_UM = 10_000.0
MAX_AUTHOR = 80
MAX_NOTE = 500

MicrometrePair = tuple[float, float]


class ReferenceSource(StrEnum):
    """Where the gaps of a reference come from."""

    GIVEN = "given"
    MEASURED = "measured"


@dataclass(frozen=True)
class GapReference:
    """A reference as it was set; never changed afterwards, only followed by a newer one.

    Parameters
    ----------
    set_ns
        When it was set, UTC.
    author
        Who set it, 1 to 80 printable characters.
    gap_reference_um
        Probe gaps (x, y) with the shaft centred, above 0 up to 10 000 µm.
    opposite_reference_um
        The same of the probes across the shaft, where the bearing has them.
    note
        At most 500 printable characters; may be empty.

    Raises
    ------
    ValueError
        If anything is outside its limits; the message gives both.
    """

    unit: str
    bearing: str
    set_ns: int
    author: str
    gap_reference_um: MicrometrePair
    opposite_reference_um: MicrometrePair | None
    source: ReferenceSource
    note: str = ""

    def __post_init__(self) -> None:
        _check_pair("gap", self.gap_reference_um)
        if self.opposite_reference_um is not None:
            _check_pair("opposite gap", self.opposite_reference_um)
        if not self.author.strip():
            raise ValueError(f"author {self.author!r} is empty; name who sets the reference")
        _check_text("author", self.author, MAX_AUTHOR)
        _check_text("note", self.note, MAX_NOTE)


def _check_pair(what: str, pair: MicrometrePair) -> None:
    for axis, gap_um in zip("xy", pair, strict=True):
        if not 0.0 < gap_um <= MAX_GAP_UM:  # not a number is neither
            raise ValueError(
                f"{what} {axis} is {gap_um:g} µm, must be above 0 and at most {MAX_GAP_UM:g} µm"
            )


def _check_text(what: str, text: str, n_most: int) -> None:
    if len(text) > n_most:
        raise ValueError(f"{what} has {len(text)} characters, must be at most {n_most}")
    if not text.isprintable():
        raise ValueError(f"{what} {text!r} must be printable characters on one line")
