"""Samples are as old as they are in their device, however late they are read."""

import pytest

from acquisition.arrival import Arrival
from acquisition.delivery import Delivery

ARRIVED = Arrival(1_767_225_600_000_000_000, 5000.0)


@pytest.fixture
def delivery(counts_calibration) -> Delivery:
    return Delivery(counts_calibration(2))


def test_what_has_waited_in_the_device_is_older_than_the_newest(delivery, counting_feed):
    feed = counting_feed()
    blocks = delivery.take_together([feed.advance(60) for _ in range(3)], ARRIVED, 0.25)
    assert [block.sampled_s for block in blocks] == pytest.approx([4999.55, 4999.65, 4999.75])


def test_what_comes_from_no_device_has_no_age(delivery, counting_feed):
    [block] = delivery.take(counting_feed().advance(60))
    assert block.sampled_s is None
