"""The port through which the program hands sample blocks to the numerics of one unit."""

from collections.abc import Iterator
from typing import Protocol

from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from core.monitor.monitor_state import MonitorState
from core.samples.blocks import SampleBlock
from core.samples.gaps import Gap, Reach, SampleAccount


class Monitor(Protocol):
    """Watches one unit.

    :class:`core.monitor.UnitMonitor` does it by waveforms,
    :class:`core.monitor.vector_monitor.VectorMonitor` by what a rack has made of them.
    """

    unit: Unit

    @property
    def account(self) -> SampleAccount:
        """Where every sample went that the unit's device offered."""
        ...

    def adopt(self, unit: Unit) -> None:
        """Take a new description of the same unit, from the next assessment on.

        Raises
        ------
        ValueError
            If more than references, clearances and brackets differ.
        """
        ...

    def go_on(self, reach: Reach | None) -> None:
        """Go on after a stop, before the first block: what is missing since then is a gap."""
        ...

    @property
    def state(self) -> MonitorState:
        """What must be known beside its newest samples to go on from here elsewhere."""
        ...

    def rewind(self, state: MonitorState) -> None:
        """Expect the samples since `state.start` once more, in a monitor that has seen none."""
        ...

    def settle(self, state: MonitorState) -> None:
        """Be as the one was that `state` is of, after these samples."""
        ...

    def drain_gaps(self) -> list[Gap]:
        """Hand over the gaps found since the last call, to be recorded."""
        ...

    def require(self, block: SampleBlock) -> None:
        """Refuse a block that does not fit the unit, with a `BlockMisfitError`."""
        ...

    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in and hand over what is learnt by it, one bearing at a time.

        Raises
        ------
        BlockMisfitError
            If the block does not fit the unit; nothing is changed then.
        """
        ...

    def ingest(self, block: SampleBlock) -> list[Assessment]:
        """Take a block in and return all that has been learnt by it; as `steps`."""
        ...
