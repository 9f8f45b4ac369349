"""Which recordings have to go: the oldest first, continuous ones before captures."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from core.units import ns_from_s
from service.recordings.keeping.ages import NotOldFrom
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
        Continuous recordings go that are older than this; see `service.recordings.keeping.ages`.
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

Remove = Callable[[WaveformFile, str], bool]
"""Removes a recording and says why; whether it is gone. The next one goes in place of one that
is not."""


def make_room(
    files: Iterable[WaveformFile],
    limits: RoomLimits,
    now_ns: int,
    need: Need,
    bound: Bound,
    remove: Remove,
) -> None:
    """Have removed what has to go, in this order.

    Raises
    ------
    OSError
        If it cannot be found out what evidence refers to; continuous recordings have gone then.
    """
    by_age = sorted(files, key=lambda file: (_stop_ns(file), file.name))
    continuous = [file for file in by_age if file.kind is WaveformKind.CONTINUOUS]
    captures = [file for file in by_age if file.kind is WaveformKind.CAPTURE]
    n_freed = _continuous(continuous, limits, now_ns, need.soft_bytes, remove)
    over = sum(file.n_bytes for file in captures) - limits.capture_bytes
    short = need.hard_bytes - n_freed
    if over > 0 or short > 0:
        _captures(captures, over, short, bound(), remove)


def _continuous(
    by_age: Sequence[WaveformFile], limits: RoomLimits, now_ns: int, short: int, remove: Remove
) -> int:
    """Remove continuous ones; how many bytes became free."""
    over = sum(file.n_bytes for file in by_age) - limits.continuous_bytes
    not_old = NotOldFrom(by_age, now_ns, ns_from_s(limits.continuous_days * S_PER_DAY))
    n_freed = 0
    for file in by_age:
        if over > n_freed:
            why = "all together are over max_gb"
        elif short > n_freed:
            why = "the disk is nearly full"
        elif not_old.is_old(file):
            why = "it is older than max_days"
        else:
            continue
        n_freed += file.n_bytes if remove(file, why) else 0
    return n_freed


def _captures(
    by_age: Sequence[WaveformFile], over: int, short: int, bound: frozenset[str], remove: Remove
) -> None:
    """The newest stays in any case; what evidence refers to goes last, and never for the disk."""
    older = by_age[:-1]
    for file in sorted(older, key=lambda file: file.name in bound):
        if over > 0:
            why = "all captures together are over max_gb"
        elif short > 0 and file.name not in bound:
            why = "the disk is nearly full"
        else:
            return
        if remove(file, why):
            over, short = over - file.n_bytes, short - file.n_bytes


def _stop_ns(file: WaveformFile) -> int:
    """When it ended, or when it was found if that cannot be read."""
    return file.stop_ns or file.changed_ns
