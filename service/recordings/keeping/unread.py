"""`Unread`: recordings that could not be read, though that says nothing of what they are."""

from collections.abc import Collection, Iterator
from contextlib import contextmanager

from acquisition.clock import Clock
from service.store.waveform_port import WaveformKind

AGAIN_S = 60.0
"""After how long one is tried again; the others come meanwhile."""

Words = tuple[int, str, str]
"""Number and text of an error, and of which recording."""


class Unread:
    """Remembers what the disk or the system refused to read, and when that is tried again."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._refused: dict[tuple[WaveformKind, str], tuple[float, Words]] = {}

    def is_due(self, kind: WaveformKind, name: str) -> bool:
        """Whether a recording may be read now."""
        tried = self._refused.get((kind, name))
        return tried is None or self._clock.monotonic_s() - tried[0] >= AGAIN_S

    @contextmanager
    def noted(self, kind: WaveformKind, name: str) -> Iterator[None]:
        """Remember it if the disk refuses in here, and forget it if it does not."""
        try:
            yield
        except OSError as error:
            words = (error.errno or 0, error.strerror or str(error), name)
            self._refused[kind, name] = (self._clock.monotonic_s(), words)
        else:
            self._refused.pop((kind, name), None)

    def keep(self, kind: WaveformKind, names: Collection[str]) -> None:
        """Forget all others of a kind."""
        gone = [key for key in self._refused if key[0] is kind and key[1] not in names]
        for key in gone:
            del self._refused[key]

    def tell(self) -> None:
        """Raise what was refused first and still is.

        Raises
        ------
        OSError
            If anything is.
        """
        for _, words in self._refused.values():
            raise OSError(*words)
