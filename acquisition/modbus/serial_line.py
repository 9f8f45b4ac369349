"""A serial port as an asyncio transport: what arrives goes to a protocol."""

import asyncio
import errno
import termios

import serial

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.reply_protocol import reason_of
from acquisition.modbus.transport import SerialTransport

_RECEIVE_BYTES = 1024


class SerialLine(asyncio.Transport):
    """An open port that no other program can open; see `open_line`."""

    def __init__(self, port: serial.Serial, protocol: asyncio.Protocol) -> None:
        super().__init__()
        self._port, self._protocol = port, protocol
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(port.fileno(), self._receive)
        protocol.connection_made(self)

    def is_closing(self) -> bool:
        """Whether it is closed."""
        return not self._port.is_open

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send a request; a port that does not take it at once is gone."""
        try:
            self._port.write(data)
        except OSError as error:
            self._lose(error)

    def close(self) -> None:
        """Give the port back; again is harmless."""
        self._lose(None)

    def _receive(self) -> None:
        try:
            data = self._port.read(_RECEIVE_BYTES)
        except (OSError, TypeError) as error:  # pyserial subtracts from None where a line is gone
            self._lose(OSError(str(error)))
            return
        if data:
            self._protocol.data_received(data)

    def _lose(self, error: OSError | None) -> None:
        if self._port.is_open:
            self._loop.remove_reader(self._port.fileno())
            self._port.close()
            self._protocol.connection_lost(error)


def open_line(settings: SerialTransport, protocol: asyncio.Protocol) -> SerialLine:
    """Open a port for this program alone.

    Raises
    ------
    LinkError
        If there is no such port, or another program has it.
    ConfigError
        If the port cannot be set up as wanted.
    """
    port = serial.Serial()
    port.port, port.baudrate, port.stopbits = settings.device, settings.baudrate, settings.stop_bits
    port.parity, port.exclusive, port.write_timeout = settings.parity[0].upper(), True, 0
    try:
        port.open()
        port.timeout = 0  # configures it again: a port reports an ignored setting only then
    except termios.error as error:  # of a port that exists but cannot be set up so
        port.close()
        kind = ConfigError if error.args[0] == errno.EINVAL else LinkError
        raise kind(f"{settings}: the port refuses its settings: {error.args[-1]}") from None
    except (OSError, EOFError) as error:
        port.close()
        raise LinkError(f"{settings}: {reason_of(error)}") from None
    return SerialLine(port, protocol)
