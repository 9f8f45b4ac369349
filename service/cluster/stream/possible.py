"""What every block of a device is like, whoever sent it: the numerics rely on it."""

import math

import numpy as np

from core.samples.blocks import SampleBlock
from service.cluster.stream.wire_errors import WireError


def require_possible(block: SampleBlock) -> None:
    """Refuse what no adapter makes, before anything reckons with it.

    Raises
    ------
    WireError
        If a block has no samples, or one that is no number, which would blind a whole spectrum; a
        slow value that is none; or less than no rejected samples.
    """
    if not block.n_samples:
        raise WireError("impossible", "a block without samples")
    if not np.isfinite(block.samples).all():
        raise WireError("impossible", "a block with samples that are no numbers")
    if not all(math.isfinite(reading.value or 0.0) for reading in block.slow.values()):
        raise WireError("impossible", "a block with a slow value that is no number")
    if any(rejection.n_samples < 0 for rejection in block.rejected):
        raise WireError("impossible", "a block before which less than no samples were rejected")
