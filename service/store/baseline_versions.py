"""Which baseline of a bearing is in force, as told by all that was done to them."""

from collections.abc import Iterable
from dataclasses import dataclass

from service.store.film_port import BaselineStep, StoredStep


@dataclass(frozen=True)
class Versions:
    """Where the baselines of a bearing stand.

    Parameters
    ----------
    in_force
        What its readings are compared with; None if there is none.
    rejected
        What must not be put in force.
    is_frozen
        Whether nothing more is learned until an engineer says so.
    renewed_ns
        From when on readings count for learning; None for all.
    first_accepted
        The first that was put in force since then.
    """

    in_force: int | None = None
    rejected: frozenset[int] = frozenset()
    is_frozen: bool = False
    renewed_ns: int | None = None
    first_accepted: int | None = None


def versions_after(steps: Iterable[StoredStep]) -> Versions:
    """Where the baselines of a bearing stand after everything that was done, oldest first."""
    in_force: int | None = None
    first: int | None = None
    rejected: set[int] = set()
    is_frozen, renewed_ns = False, None
    for done in steps:
        match done.step:
            case BaselineStep.ACCEPTED:
                in_force = done.version
                first = done.version if first is None else first
                rejected.discard(done.version or 0)
            case BaselineStep.REJECTED | BaselineStep.WITHDRAWN:
                rejected.add(done.version or 0)
                in_force = None if in_force == done.version else in_force
            case BaselineStep.FROZEN | BaselineStep.THAWED:
                is_frozen = done.step is BaselineStep.FROZEN
            case BaselineStep.RENEWED:
                in_force = first = None
                is_frozen, renewed_ns = False, done.from_ns
            case BaselineStep.LEARNED:
                pass
    return Versions(in_force, frozenset(rejected), is_frozen, renewed_ns, first)
