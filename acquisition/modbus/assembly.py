"""Neighbouring slots become one raw block, so that what follows runs once per poll."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.modbus.profile import RingLayout, Slot
from acquisition.raw import RawBlock
from core.blocks import Rejection


@dataclass(frozen=True)
class PlacedSlot:
    """A usable slot with its place on the unwrapped sample axis.

    Parameters
    ----------
    rejected
        What was refused since the slot before it.
    """

    slot: Slot
    epoch: int
    first_index: int
    rejected: tuple[Rejection, ...] = ()


def raw_blocks(
    placed: Sequence[PlacedSlot], layout: RingLayout, slow: tuple[float, ...]
) -> list[RawBlock]:
    """Join slots that follow each other without a gap, a refusal or a change of channel health."""
    groups: list[list[PlacedSlot]] = []
    for slot in placed:
        if groups and _continues(groups[-1][-1], slot, layout):
            groups[-1].append(slot)
        else:
            groups.append([slot])
    return [_block(group, layout, slow) for group in groups]


def _continues(before: PlacedSlot, after: PlacedSlot, layout: RingLayout) -> bool:
    return (
        not after.rejected
        and after.epoch == before.epoch
        and after.first_index == before.first_index + layout.samples_per_slot
        and after.slot.ok_bits == before.slot.ok_bits
    )


def _block(group: Sequence[PlacedSlot], layout: RingLayout, slow: tuple[float, ...]) -> RawBlock:
    first = group[0]
    counts = np.empty((layout.n_channels, len(group), layout.samples_per_slot), dtype=np.int16)
    for i, placed in enumerate(group):
        counts[:, i] = placed.slot.counts
    return RawBlock(
        epoch=first.epoch,
        first_index=first.first_index,
        start_ns=first.slot.start_ns,
        rate_hz=layout.rate_mhz / 1000.0,
        counts=counts.reshape(layout.n_channels, -1),
        ok=tuple(bool(first.slot.ok_bits >> c & 1) for c in range(layout.n_channels)),
        slow=slow,
        rejected=first.rejected,
    )
