"""The registers of a simulated device, as the bytes that go over the wire."""

from collections.abc import Callable


class RegisterMemory:
    """A stretch of readable registers.

    Parameters
    ----------
    start
        Address of the first register.
    n_registers
        How many there are; all others do not exist.

    Attributes
    ----------
    before_read
        Called with address and count before each read is answered: here a test lets the device
        do something between two requests.
    """

    def __init__(self, start: int, n_registers: int) -> None:
        self._start = start
        self._data = bytearray(2 * n_registers)
        self.before_read: Callable[[int, int], None] | None = None

    def write(self, address: int, data: bytes) -> None:
        """Store big-endian words.

        Raises
        ------
        ValueError
            If they do not fit; the message gives both ends.
        """
        offset = 2 * (address - self._start)
        if offset < 0 or offset + len(data) > len(self._data):
            raise ValueError(
                f"registers {address} to {address + len(data) // 2} are not in"
                f" {self._start} to {self._start + len(self._data) // 2}"
            )
        self._data[offset : offset + len(data)] = data

    def clear(self) -> None:
        """Set all registers to zero, as after power-up."""
        self._data[:] = bytes(len(self._data))

    def read(self, address: int, count: int) -> bytes | None:
        """Return big-endian words, or None if some of these registers do not exist."""
        if self.before_read is not None:
            self.before_read(address, count)
        offset = 2 * (address - self._start)
        if offset < 0 or offset + 2 * count > len(self._data):
            return None
        return bytes(self._data[offset : offset + 2 * count])
