"""`RingLayout`: where everything lies in a block ring; see `profile` for the registers."""

from dataclasses import dataclass

from acquisition.errors import ConfigError
from acquisition.modbus.transport import ADDRESS_SPACE

MAX_CHANNELS = 32
U32 = 1 << 32

_HEAD_REGISTERS = 12
_TRAILER_REGISTERS = 1
_CRC_REGISTERS = 2


@dataclass(frozen=True)
class RingLayout:
    """What stays the same while a device runs.

    Parameters
    ----------
    rate_mhz
        Samples per 1000 s and channel: the rate in millihertz.
    ring_address
        Register address of the first slot.
    slot_stride
        Registers from the start of one slot to the start of the next.
    """

    n_channels: int
    samples_per_slot: int
    n_slots: int
    rate_mhz: int
    n_slow: int
    ring_address: int
    slot_stride: int

    @property
    def slot_registers(self) -> int:
        """Registers that one slot fills."""
        n_counts = self.n_channels * self.samples_per_slot
        return _HEAD_REGISTERS + 2 * self.n_slow + n_counts + _TRAILER_REGISTERS + _CRC_REGISTERS

    @property
    def end_address(self) -> int:
        """First register address after the ring."""
        return self.ring_address + (self.n_slots - 1) * self.slot_stride + self.slot_registers

    @property
    def slot_duration_s(self) -> float:
        """Time that one slot covers."""
        return self.samples_per_slot * 1000.0 / self.rate_mhz

    def slot_address(self, sequence: int) -> int:
        """Register address at which the slot of this sequence number lies."""
        return self.ring_address + sequence % self.n_slots * self.slot_stride

    def require_possible(self) -> None:
        """Refuse a layout that cannot exist.

        Raises
        ------
        ConfigError
            Naming the field, what was found and what is allowed.
        """
        for name, value, lowest, highest in (
            ("n_channels", self.n_channels, 1, MAX_CHANNELS),
            ("samples_per_slot", self.samples_per_slot, 1, ADDRESS_SPACE - 1),
            ("n_slots", self.n_slots, 2, ADDRESS_SPACE - 1),
            ("rate in mHz", self.rate_mhz, 1, U32 - 1),
            ("slot stride", self.slot_stride, self.slot_registers, ADDRESS_SPACE - 1),
            ("end of the ring", self.end_address, 1, ADDRESS_SPACE),
        ):
            if not lowest <= value <= highest:
                raise ConfigError(
                    f"block ring: {name} is {value}, allowed is {lowest} to {highest}"
                )
