"""`Epochs`: a number for every count of a device that no other count of it has had."""

from core.units import NS_PER_S

TOLD = 1 << 32
"""Epochs that a device tells are below this; its own count of seconds begins here."""


class Epochs:
    """Numbers the counts of one device, across the lives of the adapter that reads it.

    What the adapter itself has counted, as the wraps of a narrow counter or restarts that nobody
    told, is gone when its process ends. So a count that hangs on it has a number of its own: the
    second in which the adapter began, plus the restarts since, of which there is less than one in
    a second. Only a device that tells its epoch, and counts so far that its counter need not be
    unwrapped, is on the same axis before and after.

    Parameters
    ----------
    begun_ns
        When this life of the adapter began, UTC.
    trusts_device
        Whether what the device tells is all that needs to be known.

    Attributes
    ----------
    number
        Of the present count.
    """

    def __init__(self, begun_ns: int, *, trusts_device: bool) -> None:
        self._trusts_device = trusts_device
        self._own = begun_ns // NS_PER_S + (TOLD if trusts_device else 0)
        self.number = 0 if trusts_device else self._own

    def tell(self, epoch: int) -> None:
        """Take over what the device told of the first count."""
        if self._trusts_device:
            self.number = epoch % TOLD

    def begin(self, told: int | None = None) -> None:
        """Begin another count.

        Parameters
        ----------
        told
            Its epoch, by the device; None where the device has told of no restart.
        """
        self._own += 1
        if told is not None and self._trusts_device:
            self.number = told % TOLD
        else:
            self.number = self._own
