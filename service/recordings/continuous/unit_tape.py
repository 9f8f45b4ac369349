"""`UnitTape`: the continuous recording of one unit; lives in the thread that writes."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit
from core.samples.blocks import Rejection, SampleBlock
from service.recordings.continuous.pieces import Hole, Shed, TapeSettings
from service.recordings.continuous.stretch import Stretch


class TapeError(Exception):
    """Samples could not be kept; the message says of which unit and why."""


class UnitTape:
    """Puts blocks one after the other into stretches.

    Parameters
    ----------
    end
        Epoch and index up to which the unit is recorded already; None if nothing is known.

    Attributes
    ----------
    ended
        Stretches that are to be joined.
    n_written, n_refused
        Samples per channel that are on the disk since the start, and that the disk refused.
    """

    def __init__(
        self,
        root: Path,
        unit: RecordedUnit,
        settings: TapeSettings,
        end: tuple[int, int] | None = None,
    ) -> None:
        self._root, self._unit, self._settings = root, unit, settings
        self._end = end
        self._has_begun = False
        self._stretch: Stretch | None = None
        self._hole = Hole()
        self.ended: list[Path] = []
        self.n_written = self.n_refused = 0

    def skip(self, hole: Hole) -> None:
        """Note what was left out before the next block."""
        self._hole.add(hole.epoch, (Rejection(r, n) for r, n in hole.n_samples.items()))

    def write(self, block: SampleBlock, now_s: float) -> None:
        """Append a block; a stretch that it does not fit is ended.

        Raises
        ------
        TapeError
            If it cannot be kept, or if what was to be kept before it cannot.
        """
        fresh = self._fresh(block)
        if fresh is None:
            return
        block = fresh
        if self._stretch is not None and not self._stretch.goes_on_to(block):
            self.end()
        try:
            self._put(block, now_s)
        except (ConfigError, OSError):
            with suppress(TapeError):  # counted; it may be of another type than the stretch
                self.end()
            self._try_again(block, now_s)
        self._hole.clear()
        self._has_begun, self._end = True, (block.epoch, block.stop_index)
        self.sync(now_s)

    def sync(self, now_s: float) -> None:
        """Bring the part that is being written to the disk, if it is time.

        Raises
        ------
        TapeError
            If it cannot be kept.
        """
        if self._stretch is not None and self._stretch.is_due(now_s):
            self._finish_part(self._stretch)

    def end(self) -> None:
        """End the stretch, with what there is.

        Raises
        ------
        TapeError
            If its last part cannot be kept.
        """
        stretch, self._stretch = self._stretch, None
        if stretch is not None:
            self.ended.append(stretch.folder)
            self._finish_part(stretch)

    def _fresh(self, block: SampleBlock) -> SampleBlock | None:
        """What of a block is not recorded already, as after a restart; None if all of it is."""
        if self._end is None or self._end[0] != block.epoch or block.first_index >= self._end[1]:
            return block
        if block.stop_index <= self._end[1]:
            return None
        return block.from_sample(self._end[1] - block.first_index)

    def _put(self, block: SampleBlock, now_s: float) -> None:
        told = self._hole.before(block)
        if self._stretch is None:
            told = self._after_end(told)
            self._root.mkdir(parents=True, exist_ok=True)
            self._stretch = Stretch(self._root, self._unit, told, self._settings)
        self._stretch.write(told, now_s)

    def _try_again(self, block: SampleBlock, now_s: float) -> None:
        try:
            self._put(block, now_s)
        except (ConfigError, OSError) as error:
            self._hole.skip(block, Shed.DISK_REFUSED)
            self.n_refused += block.n_samples
            with suppress(TapeError):
                self.end()
            raise self._told(error) from error

    def _finish_part(self, stretch: Stretch) -> None:
        n_samples = stretch.n_unsynced
        try:
            self.n_written += stretch.finish_part()
        except (ConfigError, OSError) as error:
            self.n_refused += n_samples
            if self._end is not None:
                self._hole.add(self._end[0], [Rejection(Shed.DISK_REFUSED, n_samples)])
            raise self._told(error) from error

    def _after_end(self, block: SampleBlock) -> SampleBlock:
        """The first block of a stretch, which says what is missing since the one before it."""
        if self._end is None or self._end[0] != block.epoch:
            return block
        n_missing = block.first_index - self._end[1] - sum(r.n_samples for r in block.rejected)
        if n_missing <= 0:
            return block
        reason = Shed.GAP_BEFORE if self._has_begun else Shed.NOT_RUNNING
        return replace(block, rejected=(*block.rejected, Rejection(reason, n_missing)))

    def _told(self, error: Exception) -> TapeError:
        return TapeError(f"samples of unit {self._unit.unit} are not recorded: {error}")
