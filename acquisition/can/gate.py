"""`FrameGate`: only what is exactly a frame of one of the configured messages gets through."""

from typing import Protocol, TypeAlias

from acquisition.can.dbc import frame_key
from acquisition.can.instants import Refusal, RefusalCounts
from acquisition.can.plan import Plan

Frame: TypeAlias = tuple[int, bytes | None]
"""Frame key and data; None as data if it came but cannot be used."""


class Message(Protocol):
    """The part of python-can's message that is looked at."""

    arbitration_id: int
    is_extended_id: bool
    is_remote_frame: bool
    is_error_frame: bool
    is_fd: bool
    dlc: int
    data: bytearray


class FrameGate:
    """Admits frames and counts the others by reason.

    Parameters
    ----------
    refused
        Where they are counted.
    """

    def __init__(self, plan: Plan, refused: RefusalCounts) -> None:
        self._shapes = {
            key: (message_plan.message.length, message_plan.message.fd)
            for key, message_plan in plan.messages.items()
        }
        self._refused = refused

    def admit(self, message: Message) -> Frame | None:
        """Return the frame; None if it is none of the configured ones."""
        key = frame_key(message.arbitration_id, message.is_extended_id)
        shape = self._shapes.get(key)
        if shape is None or message.is_error_frame:
            self._refused[self._why_foreign(message)] += 1
            return None
        length, fd = shape
        if message.is_remote_frame:
            self._refused[Refusal.REMOTE] += 1
            return None
        if message.is_fd != fd:
            self._refused[Refusal.FD if message.is_fd else Refusal.CLASSIC] += 1
            return None
        if message.dlc != length or len(message.data) != length:
            self._refused[Refusal.WRONG_LENGTH] += 1
            return key, None
        return key, bytes(message.data)

    def _why_foreign(self, message: Message) -> Refusal:
        if message.is_error_frame:
            return Refusal.ERROR
        twin = frame_key(message.arbitration_id, not message.is_extended_id)
        return Refusal.OTHER_ID_KIND if twin in self._shapes else Refusal.FOREIGN
