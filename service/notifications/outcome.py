"""What comes of one attempt to deliver a message."""

from dataclasses import dataclass
from typing import Protocol

from service.notifications.message import Message


@dataclass(frozen=True)
class Delivered:
    """The receiver has taken it."""

    answer: str


@dataclass(frozen=True)
class Refused:
    """The receiver will never take it."""

    answer: str


@dataclass(frozen=True)
class Failed:
    """It may take it later.

    Parameters
    ----------
    retry_after_s
        When it has asked to be tried again; None if it has not.
    """

    answer: str
    retry_after_s: float | None = None


Outcome = Delivered | Refused | Failed


class Carrier(Protocol):
    """Carries messages to one receiver."""

    async def carry(self, message: Message, body: str) -> Outcome:
        """Try once; ends within its time-outs, whatever the receiver does.

        Parameters
        ----------
        body
            The same message as it was written down.
        """
        ...
