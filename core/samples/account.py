"""Where every offered sample went: nothing is lost without a line in this account."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from core.samples.blocks import Rejection


@dataclass(frozen=True)
class Gap:
    """Samples that nobody delivered, per channel: exact where the device has counted them.

    Parameters
    ----------
    stop_ns
        Time of the first sample after the gap.
    start_ns
        Time of the first sample that is missing; None where it follows from the number.
    is_estimated
        Whether ``n_samples`` is worked out from the times, since the device began to count anew or
        counts nothing.
    """

    epoch: int
    first_index: int
    n_samples: int
    stop_ns: int
    start_ns: int | None = None
    is_estimated: bool = False


@dataclass(frozen=True)
class SampleAccount:
    """Samples per channel since the first block: offered = stored + flagged + gap + rejected.

    Parameters
    ----------
    n_flagged
        Held like the stored ones, but at least one channel of their block was not good.
    n_repeated
        Offered a second time and dropped; not part of the balance.
    n_restarts
        How often the device began to count anew. What it measured between the last sample that
        arrived and its restart is unknown.
    """

    n_stored: int = 0
    n_flagged: int = 0
    n_gap: int = 0
    n_repeated: int = 0
    n_restarts: int = 0
    rejected: Mapping[str, int] = field(default_factory=dict)

    @property
    def n_offered(self) -> int:
        """What the device has counted."""
        return self.n_stored + self.n_flagged + self.n_gap + sum(self.rejected.values())

    def with_taken(self, n_samples: int, n_repeated: int, *, good: bool) -> "SampleAccount":
        """Book the samples of one block."""
        return replace(
            self,
            n_stored=self.n_stored + (n_samples if good else 0),
            n_flagged=self.n_flagged + (0 if good else n_samples),
            n_repeated=self.n_repeated + n_repeated,
        )

    def with_lost(self, gap: Gap | None, rejections: tuple[Rejection, ...]) -> "SampleAccount":
        """Book what is missing before a block."""
        rejected = dict(self.rejected)
        for rejection in rejections:
            rejected[rejection.reason] = rejected.get(rejection.reason, 0) + rejection.n_samples
        n_gap = self.n_gap + (gap.n_samples if gap else 0)
        return replace(self, n_gap=n_gap, rejected=rejected)
