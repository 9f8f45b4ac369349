"""What a simulated DAQ has offered, to be compared with what arrived."""

from collections import Counter


class Ledger:
    """Samples per channel offered by each unit in each epoch, lost ones included."""

    def __init__(self) -> None:
        self._offered: Counter[tuple[str, int]] = Counter()

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Book samples that a device has produced."""
        self._offered[unit, epoch] += n_samples

    def n_samples(self, unit: str, epoch: int | None = None) -> int:
        """Samples offered by a unit, in one epoch or in all."""
        return sum(n for (u, e), n in self._offered.items() if u == unit and epoch in (None, e))
