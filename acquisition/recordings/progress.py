"""How far a recording has come: what each block must fit on to, written or read."""

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.errors import ConfigError
from acquisition.recordings.limits import (
    MAX_BLOCK_SAMPLES,
    MAX_INDEX,
    MAX_REASON_LENGTH,
    MAX_REJECTIONS,
)
from core.samples.blocks import Rejection


@dataclass(frozen=True)
class Progress:
    """All blocks up to here.

    Parameters
    ----------
    n_passed
        Samples per channel, gaps within an epoch included.
    epoch, stop_index
        Where the last block ended; no epoch before the first.
    """

    n_passed: int = 0
    epoch: int | None = None
    stop_index: int = 0

    def after(
        self, epoch: int, first_index: int, n_samples: int, rejected: Sequence[Rejection]
    ) -> "Progress":
        """Go past one more block.

        Raises
        ------
        ConfigError
            If no device can have delivered it here.
        """
        if not 1 <= n_samples <= MAX_BLOCK_SAMPLES:
            raise ConfigError(
                f"a block of {n_samples} samples; it must have 1 to {MAX_BLOCK_SAMPLES}"
            )
        for name, value in (("epoch", epoch), ("first index", first_index)):
            if not 0 <= value <= MAX_INDEX:
                raise ConfigError(f"a block of {name} {value}; it must be 0 to {MAX_INDEX}")
        expected = self.stop_index if epoch == self.epoch else 0
        n_missing = max(first_index - expected, 0)
        _require_room(rejected, n_missing)
        n_gap = n_missing if epoch == self.epoch else 0
        return Progress(self.n_passed + n_gap + n_samples, epoch, first_index + n_samples)


def _require_room(rejected: Sequence[Rejection], n_missing: int) -> None:
    if len(rejected) > MAX_REJECTIONS:
        raise ConfigError(f"a block with {len(rejected)} rejections; at most {MAX_REJECTIONS}")
    for rejection in rejected:
        if not 1 <= len(rejection.reason) <= MAX_REASON_LENGTH or rejection.n_samples < 1:
            raise ConfigError(
                f"a rejection of {rejection.n_samples} samples for {rejection.reason[:80]!r}; it"
                f" needs at least one, and a reason of 1 to {MAX_REASON_LENGTH} letters"
            )
    n_rejected = sum(rejection.n_samples for rejection in rejected)
    if n_rejected > n_missing:
        raise ConfigError(f"a block with {n_rejected} samples rejected in a jump of {n_missing}")
