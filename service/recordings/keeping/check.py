"""All recordings of a plant read from end to end and held against the index; changes nothing."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from service.recordings.continuous.names import DAMAGED
from service.recordings.keeping.folders import UNFINISHED, finished, is_recording
from service.recordings.keeping.inspection import again, inspected
from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState


class Found(StrEnum):
    """What a recording is found to be."""

    SOUND = "sound"
    NOT_ENTERED = "not_entered"
    DAMAGED = "damaged"
    MISSING = "missing"
    UNFINISHED = "unfinished"


@dataclass(frozen=True)
class Verdict:
    """What was found of one recording.

    Parameters
    ----------
    reason
        Why it is not sound; empty if it is.
    """

    kind: WaveformKind
    name: str
    found: Found
    reason: str = ""


class RecordingCheck:
    """Reads all recordings below some folders.

    Parameters
    ----------
    files
        What the index says of them.
    """

    def __init__(
        self, roots: Mapping[WaveformKind, Path], files: Iterable[WaveformFile], now_ns: int
    ) -> None:
        self._roots, self._now_ns = roots, now_ns
        self._known = {(f.kind, f.name): f for f in files if f.state is not WaveformState.REMOVED}
        self._there = [
            (kind, name)
            for kind, root in roots.items()
            for name in sorted(finished(root))
            if is_recording(root / name)
        ]
        self.n_to_read = len(self._there)

    def verdicts(self) -> Iterator[Verdict]:
        """Read one after the other.

        Raises
        ------
        OSError
            If a disk refuses.
        """
        for kind, name in self._there:
            yield self._read(kind, name)
        for kind, name in sorted(set(self._known) - set(self._there)):
            yield Verdict(kind, name, Found.MISSING, "the index has it, its folder does not")
        for kind, root in self._roots.items():
            for path in sorted(root.iterdir()) if root.is_dir() else ():
                if path.name.endswith(UNFINISHED):
                    words = "it is being written, or a start of the service finishes it"
                    yield Verdict(kind, path.name, Found.UNFINISHED, words)

    def _read(self, kind: WaveformKind, name: str) -> Verdict:
        folder, known = self._roots[kind] / name, self._known.get((kind, name))
        try:
            if known is None or not known.checksum or name.endswith(DAMAGED):
                found = inspected(folder, "", kind, self._now_ns)
            else:
                found = again(known, folder, self._now_ns)
        except OSError as error:  # nothing comes of it here but that somebody looks
            return Verdict(kind, name, Found.DAMAGED, f"it cannot be read: {error.strerror}")
        if found.state is WaveformState.DAMAGED:
            return Verdict(kind, name, Found.DAMAGED, found.reason)
        if known is None:
            words = "the running service enters it into the index"
            return Verdict(kind, name, Found.NOT_ENTERED, words)
        return Verdict(kind, name, Found.SOUND)
