"""A stretch of time out of a recording, as calibrated blocks."""

from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.delivery.calibration import calibrate
from acquisition.errors import ConfigError
from acquisition.recordings.reader import Recording
from acquisition.recordings.source import all_of
from core.samples.blocks import SampleBlock
from core.units import ns_from_s


@dataclass(frozen=True)
class RecordingWindow:
    """Blocks of a recording within a stretch of time.

    Parameters
    ----------
    start_ns, stop_ns
        Of the whole recording: its first sample, and the first one after its last.
    blocks
        Those with samples in the stretch, as far as they are of one epoch; empty in a hole.
    n_other
        Blocks of the stretch that are left out: the device began to count anew before them.
    """

    start_ns: int
    stop_ns: int
    blocks: Sequence[SampleBlock]
    n_other: int


def window_of(recording: Recording, start_s: float, seconds: float) -> RecordingWindow:
    """Read what lies within a stretch of time.

    Parameters
    ----------
    start_s
        From the first sample of the recording.

    Raises
    ------
    ConfigError
        If it cannot be read any more.
    """
    rate_hz = recording.manifest.rate_hz
    spans = [(h.start_ns, h.start_ns + ns_from_s(h.n_samples / rate_hz)) for h in recording.heads()]
    if not spans:
        raise ConfigError(f"{recording.folder}: no blocks")
    from_ns = spans[0][0] + ns_from_s(start_s)
    to_ns = from_ns + ns_from_s(seconds)
    wanted = [n for n, (begin, end) in enumerate(spans) if end > from_ns and begin < to_ns]
    blocks = _read(recording, wanted)
    same = [block for block in blocks if block.epoch == blocks[0].epoch]
    return RecordingWindow(spans[0][0], spans[-1][1], same, len(blocks) - len(same))


def _read(recording: Recording, wanted: Sequence[int]) -> list[SampleBlock]:
    calibration = all_of(recording.manifest).calibration
    if not wanted:
        return []
    raws = recording.raw_blocks(wanted[0], wanted[-1] + 1)
    return [calibrate(raw, calibration) for raw in raws]
