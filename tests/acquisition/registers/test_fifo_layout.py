"""Queues that a plant file describes: what cannot be followed is refused."""

import pytest

from acquisition.registers.cells import MapError
from acquisition.registers.fifo_layout import FifoKind, FifoLayout


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"addresses": (0,), "n_channels": 31}, "32 registers; a FIFO read has at most 31"),
        ({"addresses": (0, 1), "n_channels": 2}, "must be 1, got 2"),
        ({"addresses": (0,), "n_channels": 2, "kind": FifoKind.PER_CHANNEL}, "must be 2, got 1"),
        ({"addresses": (5, 5), "n_channels": 2, "kind": FifoKind.PER_CHANNEL}, "names a queue"),
        ({"addresses": (70_000,), "n_channels": 2}, "0 to 65535"),
        ({"addresses": (0,), "n_channels": 2, "has_counter": False, "removes": False}, "are new"),
        (
            {
                "addresses": (0, 1),
                "n_channels": 2,
                "has_counter": False,
                "kind": FifoKind.PER_CHANNEL,
            },
            "belong together",
        ),
    ],
)
def test_a_queue_that_cannot_be_followed_is_refused_at_once(settings, said: str) -> None:
    with pytest.raises(MapError, match=said):
        FifoLayout(**settings)
