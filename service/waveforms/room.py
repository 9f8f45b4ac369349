"""Which recordings have to go: the oldest first, continuous ones before captures."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from core.units import ns_from_s
from service.store.waveform_port import WaveformFile, WaveformKind

S_PER_DAY = 86_400.0


@dataclass(frozen=True)
class RoomLimits:
    """How much recordings may take.

    Parameters
    ----------
    continuous_bytes, capture_bytes
        Of all of a kind together.
    continuous_days
        Continuous recordings go that are older than the newest by more than this.
    """

    continuous_bytes: int = 100_000_000_000
    capture_bytes: int = 10_000_000_000
    continuous_days: float = 30.0


@dataclass(frozen=True)
class Need:
    """How much room has to be made on the disk.

    Parameters
    ----------
    soft_bytes
        By continuous recordings.
    hard_bytes
        By captures as well, if they are not part of any evidence.
    """

    soft_bytes: int = 0
    hard_bytes: int = 0


Bound = Callable[[], frozenset[str]]
"""Names of captures that evidence of an alarm refers to; asked only when captures have to go."""


def to_remove(
    files: Iterable[WaveformFile], limits: RoomLimits, now_ns: int, need: Need, bound: Bound
) -> list[tuple[WaveformFile, str]]:
    """What has to go and why, in this order."""
    by_age = sorted(files, key=lambda file: (_stop_ns(file), file.name))
    continuous = [file for file in by_age if file.kind is WaveformKind.CONTINUOUS]
    captures = [file for file in by_age if file.kind is WaveformKind.CAPTURE]
    removed = list(_continuous(continuous, limits, now_ns, need.soft_bytes))
    n_freed = sum(file.n_bytes for file, _ in removed)
    over = sum(file.n_bytes for file in captures) - limits.capture_bytes
    short = need.hard_bytes - n_freed
    if over > 0 or short > 0:
        removed += _captures(captures, over, short, bound())
    return removed


def _continuous(
    by_age: Sequence[WaveformFile], limits: RoomLimits, now_ns: int, short: int
) -> Iterator[tuple[WaveformFile, str]]:
    over = sum(file.n_bytes for file in by_age) - limits.continuous_bytes
    # a clock that has jumped ahead makes nothing old: then the newest recording is
    newest_ns = max((_stop_ns(file) for file in by_age), default=now_ns)
    since_ns = min(now_ns, newest_ns) - ns_from_s(limits.continuous_days * S_PER_DAY)
    for file in by_age:
        if over > 0:
            why = "all together are over max_gb"
        elif short > 0:
            why = "the disk is nearly full"
        elif _stop_ns(file) < since_ns:
            why = "it is older than max_days"
        else:
            continue
        over, short = over - file.n_bytes, short - file.n_bytes
        yield file, why


def _captures(
    by_age: Sequence[WaveformFile], over: int, short: int, bound: frozenset[str]
) -> Iterator[tuple[WaveformFile, str]]:
    """The newest stays in any case; what evidence refers to goes last, and never for the disk."""
    older = by_age[:-1]
    for file in sorted(older, key=lambda file: file.name in bound):
        if over > 0:
            why = "all captures together are over max_gb"
        elif short > 0 and file.name not in bound:
            why = "the disk is nearly full"
        else:
            return
        over, short = over - file.n_bytes, short - file.n_bytes
        yield file, why


def _stop_ns(file: WaveformFile) -> int:
    """When it ended, or when it was found if that cannot be read."""
    return file.stop_ns or file.changed_ns
