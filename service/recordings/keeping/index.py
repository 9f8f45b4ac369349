"""`Index`: the entries of one place in memory and in the store.

The store is told first, but of what is removed: that is gone whether the store can be told or not.
"""

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
        self._owed: dict[Key, WaveformFile] = {}

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
        found = {(file.kind, file.name): file for file in files}
        if found:
            self._store.put(list(found.values()))
            self._files |= found
            for key in found:
                self._owed.pop(key, None)  # there is one of that name again

    def remove(self, file: WaveformFile, reason: str, now_ns: int) -> None:
        """Strike out what is gone; `settle` tells the store."""
        gone = replace(file, state=WaveformState.REMOVED, reason=reason, changed_ns=now_ns)
        self._files.pop((file.kind, file.name), None)
        self._owed[file.kind, file.name] = gone

    def settle(self) -> None:
        """Tell the store what is gone; what it does not take is told the next time.

        Raises
        ------
        StoreError
            If it takes nothing.
        """
        if self._owed:
            self._store.put(list(self._owed.values()))
            self._owed.clear()

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

    @property
    def whole(self) -> Sequence[WaveformFile]:
        """Recordings that are there and not known to be damaged."""
        return [f for f in self._files.values() if f.state is WaveformState.PRESENT]

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
