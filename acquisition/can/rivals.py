"""`Rivals`: whether two devices speak under the same ids, so that no sample can be believed."""

_WINDOW_FRAMES = 100
_CONFLICT_SHARE = 0.2
"""A device that is alone repeats itself at most, or now and then sends a frame that is spoilt."""

_CLEAN_WINDOWS = 4


class Rivals:
    """Weighs waveform frames that fit the count against those that contradict it.

    The verdict holds until four windows without many contradictions have passed: devices that send
    in turns do not contradict each other all the time.
    """

    def __init__(self) -> None:
        self._n_windows_to_wait = 0
        self._n_fitting = self._n_contrary = 0

    @property
    def found(self) -> bool:
        """Whether there is a second device."""
        return self._n_windows_to_wait > 0

    def fits(self) -> None:
        """Note a frame that one device alone would have sent."""
        self._n_fitting += 1
        self._judge()

    def contradicts(self) -> None:
        """Note a frame that does not go with the others."""
        self._n_contrary += 1
        self._judge()

    def returns(self) -> None:
        """Note that a count goes on which another had taken the place of: no device does that."""
        self._judged(contrary=True)

    def _judge(self) -> None:
        n_frames = self._n_fitting + self._n_contrary
        if n_frames >= _WINDOW_FRAMES:
            self._judged(contrary=self._n_contrary >= _CONFLICT_SHARE * n_frames)

    def _judged(self, *, contrary: bool) -> None:
        waiting = max(0, self._n_windows_to_wait - 1)
        self._n_windows_to_wait = _CLEAN_WINDOWS if contrary else waiting
        self._n_fitting = self._n_contrary = 0
