"""`Index`: the entries of one place in memory and in the store; the store is told first."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from service.store.waveform_port import WaveformFile, WaveformKind, WaveformState, WaveformStore

Key = tuple[WaveformKind, str]

ON_DISK = (WaveformState.PRESENT, WaveformState.DAMAGED)


class Index:
    """All entries but those of what was removed; used by one thread."""

    def __init__(self, store: WaveformStore, place: str) -> None:
        self._store, self.place = store, place
        self._files = {(file.kind, file.name): file for file in store.files(place)}

    def get(self, kind: WaveformKind, name: str) -> WaveformFile | None:
        """The entry of a recording."""
        return self._files.get((kind, name))

    def names(self, kind: WaveformKind) -> set[str]:
        """Names of the recordings of a kind that should be on the disk."""
        return {f.name for f in self._files.values() if f.kind is kind and f.state in ON_DISK}

    @property
    def on_disk(self) -> Sequence[WaveformFile]:
        """Recordings that are there, damaged or not."""
        return [file for file in self._files.values() if file.state in ON_DISK]

    @property
    def faults(self) -> Mapping[str, str]:
        """Why each damaged recording is none to be served, by name."""
        return {f.name: f.reason for f in self._files.values() if f.state is WaveformState.DAMAGED}

    def put(self, files: Iterable[WaveformFile]) -> None:
        """Write entries.

        Raises
        ------
        StoreError
            If none was written.
        """
        found = list(files)
        if not found:
            return
        self._store.put(found)
        for file in found:
            if file.state is WaveformState.REMOVED:
                self._files.pop((file.kind, file.name), None)
            else:
                self._files[file.kind, file.name] = file

    def mark(
        self, files: Iterable[WaveformFile], state: WaveformState, reason: str, now_ns: int
    ) -> None:
        """Give entries another state.

        Raises
        ------
        StoreError
            If none was written.
        """
        self.put(replace(f, state=state, reason=reason, changed_ns=now_ns) for f in files)

    def longest_unchecked(self) -> WaveformFile | None:
        """What was not read for the longest time, among what is whole."""
        whole = (f for f in self._files.values() if f.state is WaveformState.PRESENT)
        return min(whole, key=lambda file: file.checked_ns, default=None)

    def forget(self, before_ns: int) -> None:
        """Drop what has long been gone.

        Raises
        ------
        StoreError
            If nothing was dropped.
        """
        self._store.forget(self.place, before_ns)
        gone = [
            key
            for key, file in self._files.items()
            if file.state is WaveformState.MISSING and file.changed_ns < before_ns
        ]
        for key in gone:
            del self._files[key]
