"""Continuous recording of all samples: settings of what is kept, and how long."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.settings.base import Identifier, MisfitError, Settings


class RecordingSettings(Settings):
    """All samples of units, kept one after the other as recordings."""

    samples: Literal["kept", "not_kept"] = "not_kept"
    """Whether all samples are "kept" or "not_kept"; those around alarms are kept in either case,
    see [capture]."""

    units: Annotated[tuple[Identifier, ...], Field(max_length=200)] = ()
    """Only of these units; empty for all. Example: ["U1", "U3"]."""

    folder: Annotated[str, StringConstraints(min_length=1)] | None = None
    """Where they are kept, relative to where padwatch is started; without it "recordings" in the
    data folder. Best on a disk of its own; example: "/srv/padwatch/recordings"."""

    length_min: Annotated[int, Field(ge=1, le=60)] = 10
    """Length of each recording, minutes; a new one begins at every full multiple of it, UTC."""

    sync_s: Annotated[float, Field(ge=1.0, le=60.0)] = 30.0
    """How often what was recorded is brought to the disk, s: a power cut costs no more than this
    and what a slow disk has let wait, at most 20 s."""

    max_gb: Annotated[float, Field(gt=0.0, le=1_000_000.0)] = 100.0
    """Space of all of them together, GB (10^9 bytes); beyond it the oldest are removed. Twelve
    channels at 600 Hz take about half a GB a day."""

    max_days: Annotated[float, Field(gt=0.0, le=36_500.0)] = 30.0
    """Those are removed that are older than this, days, counted from the moment that a day of
    recordings of the unit lies behind: no clock makes anything old before."""

    def require_units(self, units: Sequence[str]) -> None:
        """Refuse a unit that the plant does not have.

        Raises
        ------
        MisfitError
            If there is one.
        """
        for n, unit in enumerate(self.units):
            if unit not in units:
                words = f"is no unit of this plant, it has {', '.join(units)}"
                raise MisfitError(words, "recording", "units", n)

    def keeps(self, unit: str) -> bool:
        """Whether all samples of a unit are kept."""
        return self.samples == "kept" and (not self.units or unit in self.units)
