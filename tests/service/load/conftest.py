"""A block to wait on the bus."""

import numpy as np
import pytest

from core.blocks import SampleBlock
from core.quality import GOOD


@pytest.fixture
def any_block() -> SampleBlock:
    return SampleBlock("U1", 1, 0, 0, 100.0, np.zeros((1, 10), dtype=np.float32), (GOOD,))
