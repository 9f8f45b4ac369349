"""`LedgerFeed`: what a simulated device samples, by `Truth` alone."""

from acquisition.raw import RawBlock
from harness.ledger_plant import LedgerPlant
from harness.truth import N_CHANNELS, Truth

NS_PER_S = 1_000_000_000


class LedgerFeed:
    """A unit's converter; every sample follows from seed, channel, epoch and index.

    Parameters
    ----------
    t0_ns
        Time of sample 0, a whole number of microseconds.
    first_index
        Where it begins; a multiple of a slot.
    """

    def __init__(
        self, plant: LedgerPlant, unit: int, t0_ns: int, epoch: int = 1, first_index: int = 0
    ) -> None:
        self._truth = Truth(plant.seed, unit, plant.rate_hz, epoch)
        self._slot, self._t0_ns, self._next = plant.slot_samples, t0_ns, first_index

    def advance(self, n_samples: int) -> RawBlock:
        """Produce the next samples, as one slot."""
        first, self._next = self._next, self._next + n_samples
        truth = self._truth
        return RawBlock(
            epoch=truth.epoch,
            first_index=first,
            start_ns=time_ns(self._t0_ns, first, truth.rate_hz),
            rate_hz=truth.rate_hz,
            counts=truth.counts(first, n_samples),
            ok=(True,) * N_CHANNELS,
            slow=truth.slow(first // self._slot),
        )


def time_ns(t0_ns: int, index: int, rate_hz: float) -> int:
    """When a sample was taken, by the device's clock."""
    return t0_ns + round(index * NS_PER_S / rate_hz) // 1000 * 1000
