"""What every monitor keeps of its unit: its description, its samples' account, its gaps."""

from abc import ABC, abstractmethod
from collections.abc import Iterator

from core.condition.probe_axes import Growth
from core.machine.adoption import bearings_with_new_references, require_same_machine
from core.machine.unit import Unit
from core.monitor.assessment import Assessment
from core.monitor.monitor_state import MonitorState
from core.samples.blocks import BlockMisfitError, SampleBlock
from core.samples.gaps import Gap, Reach, SampleAccount, outage, restart
from core.samples.ring import Ring


class MonitoredUnit(ABC):
    """A unit that is watched.

    Parameters
    ----------
    ring
        Takes the unit's blocks, by the rules of their indices.
    """

    def __init__(self, unit: Unit, ring: Ring) -> None:
        self.unit = unit
        self._ring = ring
        self._gaps: list[Gap] = []
        self._growth: dict[str, Growth] = {}
        self._reach: Reach | None = None

    @property
    def account(self) -> SampleAccount:
        """Where every sample went that the unit's device offered."""
        return self._ring.account

    def adopt(self, unit: Unit) -> None:
        """Take a new description of the same unit, from the next assessment on.

        Parameters
        ----------
        unit
            The bearings' references, clearances and brackets may differ; what the results that
            are being averaged were made with may not.

        Raises
        ------
        ValueError
            If it does; the message says where, and gives both.
        """
        require_same_machine(self.unit, unit)
        for bearing in bearings_with_new_references(self.unit, unit):
            self._growth.pop(bearing, None)  # it counts from a reference
        self.unit = unit

    def go_on(self, reach: Reach | None) -> None:
        """Go on after a stop, before the first block: what is missing since then is a gap."""
        self._reach = reach

    @property
    @abstractmethod
    def state(self) -> MonitorState:
        """What must be known beside its newest samples to go on from here elsewhere."""

    @abstractmethod
    def rewind(self, state: MonitorState) -> None:
        """Expect the samples since `state.start` once more, in a monitor that has seen none."""

    def settle(self, state: MonitorState) -> None:
        """Be as the one was that `state` is of, after these samples."""
        self._growth = dict(state.growth)
        self._ring.account = state.account
        self._gaps.clear()

    def ingest(self, block: SampleBlock) -> list[Assessment]:
        """Take a block in and return all that has been learnt by it; as `steps`."""
        return list(self.steps(block))

    @abstractmethod
    def steps(self, block: SampleBlock) -> Iterator[Assessment]:
        """Take a block in and hand over what is learnt by it, one bearing at a time.

        Parameters
        ----------
        block
            Must follow its predecessors in index order; what is repeated is dropped.

        Yields
        ------
        One assessment for each bearing and each hop that the block completes; mostly none. They
        must all be taken before the next block.

        Raises
        ------
        BlockMisfitError
            If the block is not of this unit, or has another rate or number of channels; the
            message gives both.
        """

    def drain_gaps(self) -> list[Gap]:
        """Hand over the gaps found since the last call, to be recorded."""
        gaps, self._gaps = self._gaps, []
        return gaps

    def require(self, block: SampleBlock) -> None:
        """Refuse a block that does not fit the unit, before anything has changed.

        Raises
        ------
        BlockMisfitError
            If it is of another unit, rate or number of channels; the message gives both.
        """
        if block.unit != self.unit.id:
            raise BlockMisfitError(
                f"block of unit {block.unit!r} in the monitor of {self.unit.id!r}"
            )
        if block.rate_hz != self.unit.rate_hz:
            raise BlockMisfitError(
                f"samples at {block.rate_hz} Hz, configured {self.unit.rate_hz} Hz"
            )
        self._ring.require(block)

    def _write_to_ring(self, block: SampleBlock) -> None:
        """Take a block in; all that is missing before it is a gap, whoever has refused it."""
        epoch, n_missing = self._ring.epoch, self._ring.n_missing_before(block)
        self._ring.write(block)
        if epoch is None:
            self._gaps += outage(self._reach, block) if self._reach else []
        elif epoch != block.epoch:
            lost = restart(self._reach, block) if self._reach else None
            self._gaps += [lost] if lost else []
        if n_missing:
            first_index = block.first_index - n_missing
            estimated = any(rejection.is_estimated for rejection in block.rejected)
            self._gaps.append(
                Gap(block.epoch, first_index, n_missing, block.start_ns, is_estimated=estimated)
            )
        if block.stop_index == self._ring.stop_index:
            self._reach = Reach(block.epoch, block.stop_index, block.stop_ns)
