"""What alarms cost for each block of a unit: judging it, and keeping samples around an alarm.

A unit of twelve channels and three bearings, all limits given, a block of 50 samples (a twelfth of
a second at 600 Hz). Prints a table; ends with 1 if a healthy block costs more than its limit.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.clock import SystemClock
from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import Limits
from core.quality import Reading
from core.samples.blocks import DeviceClock, SampleBlock
from service.app.kept_files import captures_of
from service.measuring.simulated_sources import simulated_feed
from service.settings.core_values import machine_of
from service.settings.plant import load_plant_file
from service.settings.storage import Origin

DEMO = Path(__file__).parents[1] / "deploy" / "demo.toml"
LIMIT_US = 100.0
N_BLOCKS = 20_000
BLOCK_S = 50 / 600.0


def main() -> None:
    """Run the benchmark and print its table."""
    plant = load_plant_file(DEMO)
    unit = plant.unit[0]
    machine = machine_of(unit)
    limits = {
        "shaft_order1": LimitRule(Limits(300.0, 400.0, 5.0), rule_of(10.0, 30.0)),
        "oil_temperature": LimitRule(Limits(80.0, 90.0, 1.0), rule_of(10.0, 30.0)),
    }
    rules = UnitRules(bearings={bearing.id: limits for bearing in machine.bearings})
    feed = simulated_feed(unit, SystemClock())
    first = feed.advance(50)
    first = replace(first, clock=DeviceClock(0.01, 1.0, 0.5))

    def judging(blocks: list[SampleBlock]) -> float:
        alarms = UnitAlarms(machine, rules)
        alarms.link(True, None, 0)
        return mean_us(blocks, lambda block: alarms.take(block, [], block.stop_ns))

    healthy = list(blocks_like(first))
    broken = [replace(b, counts=np.full_like(b.counts, 32767)) for b in healthy]
    hot = [replace(b, elsewhere=dict.fromkeys(b.slow, Reading(85.0))) for b in healthy]
    chatter = [b if n // 20 % 2 else broken[n] for n, b in enumerate(healthy)]
    with tempfile.TemporaryDirectory() as folder:
        service = plant.service.model_copy(update={"data_folder": folder})
        captures = captures_of(
            plant.model_copy(update={"service": service}), Origin.LIVE, SystemClock()
        )
        keeping = mean_us(healthy, lambda block: captures.take(block, []))
    rows = {
        "judged, all well": judging(healthy),
        "judged, all channels bad": judging(broken),
        "judged, oil above its limit": judging(hot),
        "judged, all channels come and go": judging(chatter),
        "kept in memory for a capture": keeping,
    }
    print(f"alarms of one unit, 12 channels, 3 bearings, {N_BLOCKS:,} blocks of 50 samples")
    for words, us in rows.items():
        share = us * 1e-6 / BLOCK_S
        print(f"  {words:<34} {us:>7.1f} µs a block   {share:>7.3%} of one core")
    sys.exit(rows["judged, all well"] > LIMIT_US)


def blocks_like(first: SampleBlock) -> Iterator[SampleBlock]:
    """Blocks that follow each other, all with the same samples and good channels."""
    for number in range(N_BLOCKS):
        yield replace(
            first,
            first_index=number * 50,
            side=replace(first.side, start_ns=first.side.start_ns + round(number * BLOCK_S * 1e9)),
        )


def mean_us(blocks: list[SampleBlock], take: Callable[[SampleBlock], object]) -> float:
    """Mean time of one call."""
    started = time.perf_counter()
    for block in blocks:
        take(block)
    return (time.perf_counter() - started) / len(blocks) * 1e6


if __name__ == "__main__":
    main()
