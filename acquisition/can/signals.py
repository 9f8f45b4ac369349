"""Finding the signals that a plant file names, each for one purpose."""

from collections.abc import Mapping
from typing import TypeAlias

from acquisition.can.dbc import DbcMessage, DbcSignal
from acquisition.errors import ConfigError

Place: TypeAlias = tuple[str, int]
"""Name of a message and value of its multiplexer, 0 without one."""

_MAX_SHOWN = 12


class SignalTable:
    """The signals of a DBC; what is taken once cannot be taken again.

    Parameters
    ----------
    messages
        By name.
    """

    def __init__(self, messages: Mapping[str, DbcMessage]) -> None:
        self.messages = messages
        self._taken: dict[str, str] = {}

    def find(self, path: str, key: str) -> DbcSignal:
        """Return the signal "Message.Signal".

        Raises
        ------
        ConfigError
            If there is none; the message lists what there is.
        """
        message, _, name = path.partition(".")
        if message not in self.messages:
            raise ConfigError(
                f'{key} = "{path}": no message {message} in the DBC; there are'
                f" {_shown(self.messages)}; write Message.Signal"
            )
        if self.messages[message].nested:
            raise ConfigError(
                f'{key} = "{path}": message {message} is multiplexed twice over, which is not'
                " supported; let the device send the signal in a message of its own"
            )
        signals = self.messages[message].signals
        if name not in signals:
            raise ConfigError(
                f'{key} = "{path}": message {message} has no signal {name or "(none given)"};'
                f" there are {_shown(signals)}"
            )
        return signals[name]

    def take(self, path: str, key: str) -> DbcSignal:
        """Return a signal that nobody else may have.

        Raises
        ------
        ConfigError
            If there is none, or if it is taken.
        """
        signal = self.find(path, key)
        if path in self._taken:
            raise ConfigError(
                f'{key} = "{path}": is already the signal of {self._taken[path]};'
                " each channel needs its own"
            )
        self._taken[path] = key
        return signal

    @staticmethod
    def place(signal: DbcSignal, key: str) -> Place:
        """Message and value of its multiplexer at which the signal is there; 0 without one.

        Raises
        ------
        ConfigError
            If it is there at several values.
        """
        if len(signal.multiplexer_ids) > 1 or (
            signal.message.multiplexer is not None and not signal.multiplexer_ids
        ):
            raise ConfigError(
                f'{key} = "{signal.path}": is in every frame of a multiplexed message; only'
                " counters and frame_samples may be"
            )
        return signal.message.name, signal.multiplexer_ids[0] if signal.multiplexer_ids else 0

    @staticmethod
    def require_integer(signal: DbcSignal, key: str) -> None:
        """Refuse a signal that is scaled, signed or a float where a plain number is needed.

        Raises
        ------
        ConfigError
            Saying what it is.
        """
        if signal.is_float or signal.signed or (signal.scale, signal.offset) != (1.0, 0.0):
            raise ConfigError(
                f'{key} = "{signal.path}": must be an unsigned integer with factor 1 and offset 0'
            )


def _shown(names: Mapping[str, object]) -> str:
    listed = list(names)[:_MAX_SHOWN]
    return ", ".join([*listed, "…"] if len(names) > _MAX_SHOWN else listed)
