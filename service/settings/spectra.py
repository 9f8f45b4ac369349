"""Spectra that are kept over time."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings

EveryS = Annotated[float, Field(ge=1.0, le=86_400.0)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class SpectraSettings(Settings):
    """How many spectra of each bearing are kept; the newest ones densely, and older ones sparsely.

    A spectrum of 25 Hz at the standard settings takes 4 kB of disk with its surroundings.
    """

    dense_every_s: EveryS = 60.0
    """Time from one of the densely kept spectra to the next, s."""

    n_dense: Count = 1440
    """How many of these are kept of each bearing, the newest ones; 1440 are a day."""

    sparse_every_s: EveryS = 600.0
    """Time from one of the sparsely kept spectra to the next, s; at least dense_every_s."""

    n_sparse: Count = 52_560
    """How many of these are kept; 52560 are a year, and 0.2 GB for each bearing."""

    n_lines: Annotated[int, Field(ge=8, le=20_000)] = 1000
    """Most lines of a spectrum that are kept, from the lowest frequency on."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.sparse_every_s < self.dense_every_s:
            limit = f"must not be below dense_every_s, {self.dense_every_s:g}"
            raise MisfitError(limit, "sparse_every_s")
        return self
