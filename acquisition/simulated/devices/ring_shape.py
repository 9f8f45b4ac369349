"""`RingDeviceSettings`: the shape of a simulated ring, and the layout that follows from it."""

from dataclasses import dataclass, replace

import numpy as np

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.modbus.ring_profile import HEADER_REGISTERS, RingLayout


@dataclass(frozen=True, kw_only=True)
class RingDeviceSettings:
    """Shape of the ring.

    Parameters
    ----------
    base_address
        Register address of the header.
    samples_per_slot, n_slots
        Ring and header must fit into 65536 registers: 12 channels, 50 samples, 10 slow values and
        64 slots take 40,612.
    first_sequence
        Counter at power-up, 0 to 2**32 - 1; near the end it wraps soon.
    first_index
        Number of the first sample at power-up, 0 to 2**32 - 1; None for the feed's own.
    slot_padding
        Unused registers between slots.
    """

    base_address: int = 0
    samples_per_slot: int = 50
    n_slots: int = 64
    first_sequence: int = 0
    first_index: int | None = None
    slot_padding: int = 0


def layout_of(first: RawBlock, settings: RingDeviceSettings) -> RingLayout:
    """Lay out a ring for slots like this one.

    Raises
    ------
    ConfigError
        If it does not fit, or the slot is not one of counts.
    """
    if first.counts.dtype != np.int16:
        raise ConfigError(
            f"a block ring carries 16-bit counts, and the feed gives {first.counts.dtype}"
        )
    n_slow = len(first.slow)
    layout = RingLayout(
        n_channels=len(first.counts),
        samples_per_slot=settings.samples_per_slot,
        n_slots=settings.n_slots,
        rate_mhz=round(first.rate_hz * 1000),
        n_slow=n_slow,
        ring_address=settings.base_address + HEADER_REGISTERS + 2 * n_slow,
        slot_stride=0,
    )
    layout = replace(layout, slot_stride=layout.slot_registers + settings.slot_padding)
    layout.require_possible()
    return layout
