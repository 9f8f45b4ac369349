"""Blocks of samples in engineering units, whose qualities and readings are given as they are."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from core.arrays import RawArray, SampleArray
from core.checks.channels import VERDICT_OF, VerdictArray
from core.quality import Quality, Reading, Reason, bad
from core.samples.blocks import Rejection, SampleBlock, SideValues
from core.samples.calibration import UNLIMITED, SlowCalibration, UnitCalibration


@dataclass(frozen=True, eq=False)
class GivenBlock(SampleBlock):
    """A block whose channels have these qualities, whatever its samples are."""

    given: tuple[Quality, ...] = ()

    @cached_property
    def verdicts(self) -> VerdictArray:
        verdicts = [VERDICT_OF[quality] for quality in self.given]
        return np.repeat(np.array(verdicts, np.uint8)[:, np.newaxis], self.side.n_cells, axis=1)


def given_block(
    unit: str,
    epoch: int,
    first_index: int,
    start_ns: int,
    rate_hz: float,
    samples: SampleArray,
    channel_quality: Sequence[Quality],
    slow: Mapping[str, Reading] | None = None,
    calibration: UnitCalibration | None = None,
    **changes: object,
) -> SampleBlock:
    """A block of one cell."""
    ok = [quality != bad(Reason.SENSOR_FAILURE) for quality in channel_quality]
    block = GivenBlock(
        calibration or UnitCalibration(unit, rate_hz, (UNLIMITED,) * len(ok), ()),
        epoch,
        first_index,
        samples,
        SideValues.of(start_ns, ok, ()),
        elsewhere=slow or {},
        given=tuple(channel_quality),
    )
    return replace(block, **changes)


def cell_block(
    epoch: int,
    first_index: int,
    start_ns: int,
    rate_hz: float,
    counts: RawArray,
    ok: Sequence[bool],
    slow: Sequence[float],
    rejected: tuple[Rejection, ...] = (),
    calibration: UnitCalibration | None = None,
) -> SampleBlock:
    """A block of one cell, whose calibration has no limits if none is given."""
    if calibration is None:
        ids = (SlowCalibration(f"slow{n}", -math.inf, math.inf) for n in range(len(slow)))
        calibration = UnitCalibration("U1", rate_hz, (UNLIMITED,) * len(counts), tuple(ids))
    side = SideValues.of(start_ns, ok, slow)
    return SampleBlock(calibration, epoch, first_index, counts, side, rejected)


def with_quality(block: SampleBlock, quality: Sequence[Quality]) -> SampleBlock:
    """The same block with these qualities of its channels."""
    rest = {name: value for name, value in vars(block).items() if name in _FIELDS}
    return GivenBlock(**(rest | {"given": tuple(quality)}))


def starting_at(block: SampleBlock, start_ns: int) -> SampleBlock:
    """The same block at another time."""
    side = block.side
    shifted = replace(side, start_ns=side.start_ns - side.start_ns[0] + start_ns)
    return replace(block, side=shifted)


def of_unit(block: SampleBlock, **changes: object) -> SampleBlock:
    """The same block of another unit or at another rate."""
    return replace(block, calibration=replace(block.calibration, **changes))


_FIELDS = set(SampleBlock.__dataclass_fields__)
