"""The index of waveform files, as the rest of the service sees it."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol


class WaveformKind(StrEnum):
    """What a recording was made for."""

    CAPTURE = "capture"
    CONTINUOUS = "continuous"


class WaveformState(StrEnum):
    """What has become of a recording."""

    PRESENT = "present"
    DAMAGED = "damaged"
    MISSING = "missing"
    REMOVED = "removed"


@dataclass(frozen=True)
class WaveformFile:
    """A recording in one of padwatch's folders.

    Parameters
    ----------
    place
        Which data folder it is in, as several may share a database.
    name
        Of its folder, within the folder of its kind.
    start_ns, stop_ns
        Time of the first sample and of the first one after the last.
    n_samples
        Per channel.
    n_bytes
        Of all its files.
    checksum
        SHA-256 of its manifest, which has those of its other files; empty if it cannot be read.
    reason
        Why it is in its state.
    changed_ns
        Since when it is.
    checked_ns
        When all of it was read last.
    """

    place: str
    kind: WaveformKind
    name: str
    unit: str
    start_ns: int
    stop_ns: int
    n_samples: int
    n_bytes: int
    checksum: str
    state: WaveformState = WaveformState.PRESENT
    reason: str = ""
    changed_ns: int = 0
    checked_ns: int = 0


class WaveformStore(Protocol):
    """The index: what there is and was, and in which state; the files themselves lie elsewhere."""

    def put(self, files: Sequence[WaveformFile]) -> None:
        """Write entries in one transaction; one of the same place, kind and name is replaced.

        Raises
        ------
        StoreError
            If nothing was written.
        """
        ...

    def files(self, place: str) -> list[WaveformFile]:
        """All entries of a place but those of what was removed, oldest first."""
        ...

    def forget(self, place: str, before_ns: int) -> int:
        """Drop entries of what was removed or missing before a time; return how many."""
        ...
